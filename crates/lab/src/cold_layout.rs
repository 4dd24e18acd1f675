//! How the COLD database lies on disk: what reads it and the simulator, which writes the same, agree here.
//!
//! `cold-LAB/part_P/seqN_LIGHTn/` holds `std_cam/`, `omni_cam/`, `localization/places.lst`, and in `odom_scans/` what the wheels
//! and the laser measured, [`odom.tdf` and `scans.tdf`](tdf).

pub mod tdf;

/// The folder of the perspective camera's frames.
pub const PERSPECTIVE_FOLDER: &str = "std_cam";
/// The folder of the omnidirectional camera's frames.
pub const OMNIDIRECTIONAL_FOLDER: &str = "omni_cam";
/// The folder of the labels, in that of a sequence.
pub const LABEL_FOLDER: &str = "localization";
/// The labels: a frame and its place a line.
pub const LABEL_FILE: &str = "places.lst";
/// The folder of odometry and scans, in that of a sequence.
pub const SENSES_FOLDER: &str = "odom_scans";
/// The odometry: a pose a line.
pub const ODOMETRY_FILE: &str = "odom.tdf";
/// What the laser measured: a scan a line.
pub const SCAN_FILE: &str = "scans.tdf";
/// What the folder of a lab begins with; older archives leave it out.
pub const LAB_PREFIX: &str = "cold-";
/// The folders of a lab's areas.
pub const PART_FOLDERS: [&str; 2] = ["part_a", "part_b"];

/// The number in the name of a sequence: 1 and 2 are of the first area, the even ones of the extended path.
pub fn sequence_number(part_idx: usize, is_extended: bool) -> usize {
    1 + 2 * part_idx + usize::from(is_extended)
}
