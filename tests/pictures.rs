//! Pictures of every kind give the luma that Pillow reads in them.
//!
//! `tests/pictures/matrix.py` makes the pictures, `make test-python` runs both.

use roomsight::image::{Image, Limits};
use std::env;
use std::fs;
use std::path::PathBuf;

/// How far the luma of a pixel may be from Pillow's.
const TOLERANCE: u8 = 2;

/// A matrix of fewer pictures was not written whole.
const MIN_PICTURES: usize = 2000;

#[test]
fn pictures_give_the_luma_that_pillow_reads() {
    let Some(folder) = env::var_os("ROOMSIGHT_PICTURES").map(PathBuf::from) else {
        eprintln!(
            "LEFT OUT: the pictures to compare are made by tests/pictures/matrix.py, see `make test-python`"
        );
        return;
    };
    let mut wrong = Vec::new();
    let mut n_pictures = 0;
    for entry in fs::read_dir(&folder).expect("ROOMSIGHT_PICTURES names a folder") {
        let path = entry.unwrap().path();
        let Some(of_picture) = path.to_str().unwrap().strip_suffix(".luma") else { continue };
        n_pictures += 1;
        if let Err(reason) = compare(&fs::read(of_picture).unwrap(), &fs::read(&path).unwrap()) {
            wrong.push(format!("{of_picture}: {reason}"));
        }
    }
    assert!(n_pictures >= MIN_PICTURES, "only {n_pictures} pictures are in {}", folder.display());
    assert!(wrong.is_empty(), "{} of {n_pictures}:\n{}", wrong.len(), wrong.join("\n"));
}

/// Width and height as 32-bit numbers, then the pixels: what `matrix.py` writes.
fn compare(picture: &[u8], expected: &[u8]) -> Result<(), String> {
    let (sides, pixels) = expected.split_at(8);
    let &[width, height] = sides.as_chunks::<4>().0 else { return Err("its luma is too short".into()) };
    let [width, height] = [width, height].map(|side| u32::from_le_bytes(side) as usize);
    let image = Image::decode(picture, &Limits::default()).map_err(|error| error.to_string())?;
    if (image.width(), image.height()) != (width, height) {
        return Err(format!("{} x {} instead of {width} x {height}", image.width(), image.height()));
    }
    if image.damaged_rows() > 0 {
        return Err(format!("{} rows are taken to be damaged", image.damaged_rows()));
    }
    let differences = image.pixels().iter().zip(pixels).map(|(&ours, &theirs)| ours.abs_diff(theirs));
    match differences.max() {
        Some(largest) if largest > TOLERANCE => Err(format!("a pixel is {largest} off")),
        _ => Ok(()),
    }
}
