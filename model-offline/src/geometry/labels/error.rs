//! Why labels make no body.

/// Why labels make no body.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LabelError {
    /// No voxel has one of the labels.
    #[error("no voxel has one of the labels {wanted:?}; the image has {present:?}: choose some of these")]
    Absent {
        /// Labels that were asked for.
        wanted: Vec<u16>,
        /// Labels in the image, the first twenty.
        present: Vec<u16>,
    },
    /// Axes of voxels are not at right angles, so that distances in voxels are not distances in space.
    #[error("axes {} and {} of the voxels are at {angle:.2}° and not at right angles: resample the image \
        (in 3D Slicer: Resample Scalar Volume)", .axes[0], .axes[1])]
    Sheared {
        /// Which axes, from 0.
        axes: [usize; 2],
        /// Angle between them in degrees.
        angle: f64,
    },
    /// The smoothing is no width that can be used.
    #[error("a smoothing of {0} voxels: it is between 0 and 10")]
    Smoothing(f64),
    /// The image does not hold what its size says.
    #[error("the image has {found} labels, and its size {size:?} asks for another number")]
    Size {
        /// Labels that are there.
        found: usize,
        /// Voxels along each axis.
        size: [usize; 3],
    },
    /// The body with what is around it for smoothing has too many voxels.
    #[error("the box around labels {wanted:?} has {} × {} × {} voxels with its margin, and at most {most} are used: \
        resample the image to larger voxels", .size[0], .size[1], .size[2])]
    TooLarge {
        /// Labels that were asked for.
        wanted: Vec<u16>,
        /// Voxels along each axis.
        size: [usize; 3],
        /// The limit.
        most: u64,
    },
    /// Nothing of the body is left after smoothing.
    #[error("nothing is left of labels {wanted:?} after smoothing by {smoothing} voxels: smooth less")]
    Vanished {
        /// Labels that were asked for.
        wanted: Vec<u16>,
        /// Width in voxels.
        smoothing: f64,
    },
}

impl LabelError {
    /// What to do.
    pub fn help(&self) -> &'static str {
        match self {
            Self::Absent { .. } => "give a label that the file has, e.g. body = [1, 2]",
            Self::Sheared { .. } => {
                "resample the image to voxels with axes at right angles, and name the new file here"
            }
            Self::Smoothing(_) => "smooth by a width between 0 and 10 voxels",
            Self::Size { .. } => "export the image again: the file is not whole",
            Self::TooLarge { .. } => {
                "resample the image to larger voxels (in 3D Slicer: Crop Volume), and name the new file here"
            }
            Self::Vanished { .. } => "take another label, or resample the image to smaller voxels",
        }
    }
}
