use super::super::{nifti, nrrd, write_nifti};
use super::made;
use crate::geometry::labels::{LabelBody, LabelError, Labels, synthetic_breast, synthetic_scan};
use crate::geometry::{Implicit as _, Point};
use nalgebra::{Matrix3, Matrix4, Vector3};
use std::collections::{BTreeMap, BTreeSet};

/// Volume of a body by counting points of a lattice.
fn volume(body: &LabelBody, step: f64) -> f64 {
    let (low, high) = body.bounds().unwrap();
    let counts = (high - low).map(|length| (length / step).ceil() as usize);
    let mut inside = 0;
    for k in 0..counts.z {
        for j in 0..counts.y {
            for i in 0..counts.x {
                let at = Point::<3>::new(i as f64, j as f64, k as f64).add_scalar(0.5) * step;
                inside += usize::from(body.level(&(low + at)) < 0.0);
            }
        }
    }
    inside as f64 * step.powi(3)
}

/// The image that `testdata/make.py` writes.
fn check_made(name: &str, labels: &Labels) {
    assert_eq!(labels.size, [6, 5, 4], "{name}");
    for (i, label) in labels.data.iter().enumerate() {
        let (i, j, k) = (i % 6, i / 6 % 5, i / 30);
        assert_eq!(usize::from(*label), (i + 2 * j + 3 * k) % 5, "{name}: {i} {j} {k}");
    }
    let (c, s) = (0.5_f64.cos(), 0.5_f64.sin());
    let turn = Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0) * Matrix3::new(1.0, 0.0, 0.0, 0.0, c, -s, 0.0, s, c);
    let axes = turn * Matrix3::from_diagonal(&Vector3::new(-1.0, 2.0, 3.0));
    let apart = (labels.axes() - axes).amax();
    assert!(apart < 1e-5, "{name}: {}", labels.to_world);
    let origin = labels.world([0.0; 3]) - Vector3::new(10.0, -20.0, 30.0);
    assert!(origin.amax() < 1e-5, "{name}: {}", labels.to_world);
    assert!((labels.voxel_volume() - 6.0).abs() < 1e-4);
}

#[test]
fn files_of_nibabel_and_pynrrd_are_at_the_same_place() {
    for name in ["labels_u8.nii.gz", "labels_i16_sform.nii", "labels_f32_qform.nii", "labels_scaled.nii.gz"] {
        let found = nifti::read(&made(name)).unwrap_or_else(|wrong| panic!("{name}: {wrong}"));
        check_made(name, &found.value);
        assert_eq!(found.notes, Vec::<String>::new(), "{name}");
    }
    for name in ["labels_raw.nrrd", "labels_gzip.nrrd", "labels_ascii.nrrd", "labels_ras.nrrd"] {
        let found = nrrd::read(&made(name)).unwrap_or_else(|wrong| panic!("{name}: {wrong}"));
        check_made(name, &found.value);
        assert_eq!(found.notes, Vec::<String>::new(), "{name}");
        assert_eq!(found.value.names, BTreeMap::from([(2, "tumour".to_owned())]), "{name}");
    }
}

#[test]
fn fields_of_a_header_are_heeded() {
    let file = made("labels_f32_qform.nii");
    let changed = |at: usize, bytes: &[u8]| {
        let mut file = file.clone();
        file[at..at + bytes.len()].copy_from_slice(bytes);
        nifti::read(&file)
    };
    // Voxel (1, 0, 0) of value 1.
    let half = changed(352 + 4, &0.5_f32.to_le_bytes()).unwrap_err().to_string();
    assert!(half.contains("voxel (1, 0, 0)") && half.contains("0.5"), "{half}");
    assert!(changed(352 + 4, &f32::NAN.to_le_bytes()).is_err());
    assert!(changed(352 + 4, &(-1.0_f32).to_le_bytes()).is_err());
    assert!(changed(352 + 4, &65536.0_f32.to_le_bytes()).is_err());
    assert!(changed(70, &[128, 0]).unwrap_err().to_string().contains("colours"));
    assert!(changed(344, b"ni1\0").unwrap_err().to_string().contains(".img"));
    assert!(changed(256, &2.0_f32.to_le_bytes()).is_err(), "a quaternion of length 2");
    let metres = changed(123, &[1]).unwrap();
    assert!((metres.value.voxel_volume() / 6e9 - 1.0).abs() < 1e-5 && metres.notes.len() == 1);
    let nowhere = changed(252, &[0, 0]).unwrap();
    assert!((nowhere.value.axes() - Matrix3::from_diagonal(&Vector3::new(1.0, 2.0, 3.0))).amax() < 1e-6);
    assert!(nowhere.notes[0].contains("does not say where"));
    let nrrd_file = String::from_utf8(made("labels_ascii.nrrd")).unwrap();
    let told = |from: &str, to: &str| {
        assert!(nrrd_file.contains(from), "{from}: {nrrd_file}");
        nrrd::read(nrrd_file.replace(from, to).as_bytes()).unwrap_err().to_string()
    };
    assert!(told("encoding: ascii", "encoding: bzip2").contains("gzip"));
    assert!(told("encoding: ascii", "encoding: ascii\ndata file: a.raw").contains("a.raw"));
    assert!(told("left-posterior-superior", "here").contains("line"));
    assert!(told("dimension: 3", "dimension: 4").contains("4 axes"));
}

/// With `STILLPOINT_WRITE_SCAN` set it is written again.
#[test]
fn the_bundled_scan_is_the_made_up_one() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/scan.nii.gz");
    let made = write_nifti(&synthetic_scan()).unwrap();
    if std::env::var_os("STILLPOINT_WRITE_SCAN").is_some() {
        std::fs::write(&path, &made).unwrap();
    }
    assert_eq!(std::fs::read(&path).unwrap(), made);
}

#[test]
fn the_made_up_breast_goes_through_a_file_and_has_its_volumes() {
    let labels = synthetic_breast();
    let bytes = write_nifti(&labels).unwrap();
    assert!(bytes.len() < 6000, "{}", bytes.len());
    assert_eq!(bytes, write_nifti(&synthetic_breast()).unwrap());
    let found = nifti::read(&bytes).unwrap();
    assert_eq!(
        (&found.value.data, found.value.size, found.value.to_world),
        (&labels.data, labels.size, labels.to_world)
    );
    let ball = |radius: f64| 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3);
    let body = 0.5 * ball(1.0) * 60.0 * 60.0 * 50.0;
    let expected = [body - ball(8.0) - ball(5.0), ball(8.0), ball(5.0)];
    // The smaller ball has 56 voxels.
    for ((count, expected), within) in labels.counts().iter().zip(expected).zip([0.01, 0.05, 0.2]) {
        assert!((count.volume / expected - 1.0).abs() < within, "{count:?}, {expected}");
    }
    let whole = LabelBody::new(&labels, &BTreeSet::from([1, 2, 3]), 0.7).unwrap();
    let part = volume(&whole, 1.5) / body - 1.0;
    assert!(part.abs() < 0.02, "{part}");
    // The flat side, away from its rim.
    for (x, y) in [(0.0, 0.0), (30.0, -20.0), (-40.0, 10.0)] {
        let level = whole.level(&Point::<3>::new(x, y, 0.0));
        assert!(level.abs() < 0.1, "{x}, {y}: {level}");
    }
    let large =
        Labels { size: [40_000, 1, 1], to_world: Matrix4::identity(), data: vec![0; 40_000], names: BTreeMap::new() };
    assert!(matches!(write_nifti(&large), Err(LabelError::Size { .. })));
}
