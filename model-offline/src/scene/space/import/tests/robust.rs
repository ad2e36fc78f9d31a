//! Files cut off at every byte, and files with bytes changed: an error or a value, never a panic.

use super::super::*;
use super::made;
use crate::geometry::labels::synthetic_breast;
use crate::geometry::surface::solids::{files, tetrahedron};
use crate::random::SplitMix64;

type Reader = fn(&[u8]) -> Result<usize, ReadError>;

fn surfaces(
    read: fn(&[u8]) -> Result<Noted<crate::geometry::surface::TriangleSurface>, ReadError>,
    bytes: &[u8],
) -> Result<usize, ReadError> {
    let found = read(bytes)?;
    // What comes out must be fit for the checks, too.
    let _ = found.value.check();
    Ok(found.value.triangles.len())
}

/// Small files of every format and kind, with their readers.
fn all() -> Vec<(String, Vec<u8>, Reader)> {
    let mut all: Vec<(String, Vec<u8>, Reader)> = Vec::new();
    for (name, bytes) in files(&tetrahedron()) {
        let reader: Reader = match name.rsplit('.').next() {
            Some("stl") => |bytes| surfaces(stl::read, bytes),
            Some("obj") => |bytes| surfaces(obj::read, bytes),
            _ => |bytes| surfaces(ply::read, bytes),
        };
        all.push((name.to_owned(), bytes, reader));
    }
    for name in ["labels_u8.nii.gz", "labels_i16_sform.nii", "labels_f32_qform.nii"] {
        all.push((name.to_owned(), made(name), |bytes| nifti::read(bytes).map(|found| found.value.data.len())));
    }
    for name in super::tetrahedra::FILES {
        let reader: Reader = match name.rsplit('.').next() {
            Some("msh") => |bytes| msh::read(bytes).map(|found| found.value.tetrahedra.len()),
            _ => |bytes| vtu::read(bytes).map(|found| found.value.tetrahedra.len()),
        };
        all.push((name.to_owned(), made(name), reader));
    }
    for name in ["labels_raw.nrrd", "labels_gzip.nrrd", "labels_ascii.nrrd", "labels_ras.nrrd"] {
        all.push((name.to_owned(), made(name), |bytes| nrrd::read(bytes).map(|found| found.value.data.len())));
    }
    all
}

/// How much of the end of a text may be missing without anything missing: blanks, a name, a last number's digits.
fn may_miss(name: &str) -> usize {
    match name {
        "ascii.stl" => " a facet of tests\n".len(),
        // The end of an OBJ file is not marked: what is left of its faces is read, and the surface is open.
        ".obj" => usize::MAX,
        "ascii.ply" => " 0.25\n".len(),
        "labels_ascii.nrrd" => 1,
        // The tags that close a section, or the whole file, and blanks before them.
        _ if name.ends_with(".msh") => "\n$EndElements\n".len() + 3,
        _ if name.ends_with(".vtu") => "\n  </AppendedData>\n</VTKFile>\n".len(),
        _ => 0,
    }
}

#[test]
fn a_file_cut_off_at_any_byte_is_refused() {
    for (name, bytes, read) in all() {
        let whole = read(&bytes).unwrap_or_else(|wrong| panic!("{name}: {wrong}"));
        let step = 1 + bytes.len() / 4000;
        let ends = (0..bytes.len()).filter(|end| end % step == 0 || bytes.len() - end < 300);
        for end in ends {
            let found = read(&bytes[..end]);
            if bytes.len() - end > may_miss(&name) {
                assert!(found.is_err(), "{name} is read though it is cut off at byte {end} of {}", bytes.len());
            } else if let Ok(found) = found {
                assert!(found <= whole, "{name}, {end}");
            }
        }
    }
}

#[test]
fn an_obj_file_without_its_last_faces_is_open() {
    let (_, bytes, _) = all().into_iter().find(|(name, ..)| name == ".obj").unwrap();
    for end in 0..bytes.len() - 1 {
        if let Ok(found) = obj::read(&bytes[..end]) {
            let is_whole = found.value.triangles.len() == 4;
            assert!(is_whole || found.value.check().is_err(), "{end}");
        }
    }
}

#[test]
fn changed_bytes_give_an_error_or_a_value() {
    let mut random = SplitMix64(2026);
    for (name, bytes, read) in all() {
        let tries = 2_000_000 / bytes.len().max(1000);
        for _ in 0..tries {
            let mut changed = bytes.clone();
            for _ in 0..1 + (4.0 * random.unit()) as usize {
                // Most of what can go wrong stands at the beginning.
                let length = if random.unit() < 0.5 { bytes.len() } else { bytes.len().min(400) };
                let at = (random.unit() * length as f64) as usize;
                changed[at] = match (random.unit() * 5.0) as usize {
                    0 => 0,
                    1 => 0xff,
                    2 => changed[at] ^ (1 << (random.unit() * 8.0) as usize),
                    3 => b'0' + (random.unit() * 10.0) as u8,
                    _ => (random.unit() * 256.0) as u8,
                };
            }
            // The name is what a panic is to be told with.
            let found = std::panic::catch_unwind(|| read(&changed).map(drop));
            assert!(found.is_ok(), "{name}: a panic");
        }
    }
}

#[test]
fn random_bytes_give_an_error() {
    let mut random = SplitMix64(7);
    let readers: Vec<Reader> = all().into_iter().map(|(.., read)| read).collect();
    let starts: [&[u8]; 9] = [
        b"",
        b"solid",
        b"ply\n",
        b"v 1 2 3\nf ",
        b"\x1f\x8b\x08\0",
        b"\x5c\x01\0\0",
        b"NRRD0004\ntype: int\n",
        b"$MeshFormat\n2.2 0 8\n",
        b"<VTKFile type=\"UnstructuredGrid\">",
    ];
    for start in starts {
        for length in 0..400 {
            let mut bytes = start.to_vec();
            bytes.extend((0..length).map(|_| (random.unit() * 256.0) as u8));
            readers.iter().for_each(|read| drop(read(&bytes)));
        }
    }
}

#[test]
fn headers_that_promise_billions_are_refused_at_once() {
    let mut stl = files(&tetrahedron())[1].1.clone();
    stl[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    assert!(stl::read(&stl).is_err());
    let ply = String::from_utf8(files(&tetrahedron())[4].1.clone()).unwrap();
    for (from, to) in [
        ("vertex 4", "vertex 18446744073709551615"),
        ("face 4", "face 4000000000"),
        ("comment of tests", "element nothing 18446744073709551615"),
    ] {
        assert!(ply.contains(from));
        let started = std::time::Instant::now();
        let _ = ply::read(ply.replace(from, to).as_bytes());
        assert!(started.elapsed().as_secs() < 2, "{to}");
    }
    let mut nii = made("labels_i16_sform.nii");
    nii[42..48].copy_from_slice(&[0xff, 0x7f, 0xff, 0x7f, 0xff, 0x7f]);
    assert!(matches!(nifti::read(&nii), Err(ReadError::TooLarge { .. })));
    nii[42..48].copy_from_slice(&[0, 1, 0, 1, 0, 1]);
    assert!(nifti::read(&nii).unwrap_err().to_string().contains("do not fit"));
    let msh = String::from_utf8(made("tets_gmsh_22.msh")).unwrap();
    let vtu = String::from_utf8(made("tets_meshio_ascii.vtu")).unwrap();
    let started = std::time::Instant::now();
    assert!(msh::read(msh.replace("\n46\n", "\n18446744073709551615\n").as_bytes()).is_err());
    assert!(msh::read(msh.replace("$Elements\n", "$Elements\n9").as_bytes()).is_err());
    assert!(vtu::read(vtu.replace("=\"156\"", "=\"4000000000000\"").as_bytes()).is_err());
    // Two thousand million blocks, and blocks of nothing but zeros that unpack to more than is read.
    let array = |header: &[u32], data: &[u8]| {
        let mut bytes: Vec<u8> = header.iter().flat_map(|n| n.to_le_bytes()).collect();
        bytes.extend(data);
        let mut file = b"<VTKFile type=\"UnstructuredGrid\" compressor=\"vtkZLibDataCompressor\"><Piece><Points>\
            <DataArray type=\"Float64\" format=\"appended\" offset=\"0\"/></Points></Piece><AppendedData encoding=\"raw\">_"
            .to_vec();
        file.extend(bytes);
        file
    };
    assert!(vtu::read(&array(&[2_000_000_000, 8, 8], &[0; 64])).is_err());
    assert!(matches!(vtu::read(&array(&[u32::MAX, 8, 8], &[0; 64])), Err(ReadError::TooLarge { .. })));
    assert!(started.elapsed().as_secs() < 5);
    let nrrd = String::from_utf8(made("labels_ascii.nrrd")).unwrap().replace("sizes: 6 5 4", "sizes: 4000000000 5 4");
    assert!(matches!(nrrd::read(nrrd.as_bytes()), Err(ReadError::TooLarge { .. })));
}

#[test]
fn a_segmentation_cut_off_within_its_checksum_is_refused() {
    let bytes = write_nifti(&synthetic_breast()).unwrap();
    for end in bytes.len() - 12..bytes.len() {
        assert!(nifti::read(&bytes[..end]).is_err(), "{end}");
    }
    let mut changed = bytes.clone();
    let last = changed.len() - 6;
    changed[last] ^= 1;
    assert!(nifti::read(&changed).is_err(), "the checksum is wrong");
}
