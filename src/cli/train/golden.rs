//! Frames that are kept with a model.

use roomsight_lab::dataset::{Dataset, Described};
use roomsight_lab::validate;
use roomsight_recognition::model::{GoldenFrame, Model};
use roomsight_vision::image::Limits;
use std::path::Path;

/// Frames kept with the model to tell that it still answers the same.
const N_GOLDEN_FRAMES: usize = 8;

/// The longest frame that is kept so, in bytes.
const MAX_GOLDEN_BYTES: usize = 1 << 20;

/// The longest name of a golden frame, in characters, which take up to 4 of a file name's 255 bytes.
const MAX_FILE_NAME_LENGTH: usize = 48;

/// The longest ending of a picture's name that is kept, in bytes.
const MAX_ENDING_LENGTH: usize = 5;

/// The middle frame of each room, up to [`N_GOLDEN_FRAMES`] rooms.
pub(super) fn frames(
    model: &Model,
    dataset: &Dataset,
    described: &Described,
    limits: &Limits,
) -> Vec<GoldenFrame> {
    // Whoever loads the model reads its frames within the default limits: it must see what training saw.
    let looks_the_same = |bytes: &[u8]| {
        let size = |limits: Limits| {
            let image = model.decode(bytes, &limits).ok()?;
            Some((image.width(), image.height()))
        };
        size(*limits) == size(Limits::default())
    };
    let golden = |(room_idx, room): (usize, &String)| {
        let of_room: Vec<usize> =
            (0..described.samples.len()).filter(|&idx| described.samples[idx].room == *room).collect();
        let sample_idx = *of_room.get(of_room.len() / 2)?;
        let frame = &dataset.frames[described.frame_idxs[sample_idx]];
        let small = Limits { max_bytes: MAX_GOLDEN_BYTES, ..*limits };
        let bytes = frame.read_encoded(&small).ok().filter(|bytes| looks_the_same(bytes))?;
        let scan = frame.read_scan().ok()?.filter(|_| model.wants_scans());
        let answer = validate::answer(model, &described.samples, sample_idx);
        Some(GoldenFrame {
            name: golden_name(model.rooms(), room_idx, &frame.path),
            bytes,
            scan: scan.as_deref().cloned(),
            probability: answer.recognition.probability(),
            room: answer.room,
        })
    };
    model.rooms().iter().enumerate().take(N_GOLDEN_FRAMES).filter_map(golden).collect()
}

/// The name of the file with a room's golden frame: the room's as a file name, with a number where an earlier
/// room has the same, and the ending of the picture, which may be missing or be no ending at all.
fn golden_name(rooms: &[String], room_idx: usize, picture: &Path) -> String {
    let name = file_name(&rooms[room_idx]);
    let is_taken = rooms[..room_idx].iter().any(|room| file_name(room).to_lowercase() == name.to_lowercase());
    let ending = picture.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    let is_plain =
        (1..=MAX_ENDING_LENGTH).contains(&ending.len()) && ending.chars().all(char::is_alphanumeric);
    let ending = if is_plain { ending } else { "jpg" };
    if is_taken { format!("{name}-{room_idx}.{ending}") } else { format!("{name}.{ending}") }
}

/// A room's name as a file name of every system.
fn file_name(room: &str) -> String {
    let letters = room.chars().map(|letter| if letter.is_alphanumeric() { letter } else { '_' });
    letters.take(MAX_FILE_NAME_LENGTH).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_room_has_a_golden_frame_of_its_own() {
        let rooms = ["a b", "a/b", "a_B", "b", &"long".repeat(60)].map(str::to_owned);
        let name = |room_idx, picture| golden_name(&rooms, room_idx, Path::new(picture));
        assert_eq!(name(0, "1.jpeg"), "a_b.jpeg");
        assert_eq!(name(1, "1.PNG"), "a_b-1.PNG");
        assert_eq!(name(2, "1"), "a_B-2.jpg");
        assert_eq!(name(3, "1.jpg (copy)"), "b.jpg");
        assert_eq!(name(4, "1.jpg").len(), 52);
    }
}
