//! What is missing in a set for a good training.

use roomsight_protocol::sets::SetRoom;
use roomsight_recognition::model::ELSEWHERE;

/// A start, as measured with photos (docs/RESULTS.md).
const FEW_FRAMES: usize = 12;
/// From here on more frames of the same drive help little.
const GOOD_FRAMES: usize = 40;
/// A room with so many times the frames of another weighs too much.
const UNEVEN: usize = 8;

/// What to do next, the gravest first; nothing where the set is good.
pub fn advice(rooms: &[SetRoom]) -> Vec<String> {
    let (elsewhere, rooms): (Vec<&SetRoom>, Vec<&SetRoom>) =
        rooms.iter().partition(|room| room.name == ELSEWHERE);
    let mut advice = Vec::new();
    if rooms.len() < 2 {
        let missing = if rooms.is_empty() {
            "Add frames of two rooms at least."
        } else {
            "Add at least one other room."
        };
        advice.push(missing.to_owned());
    }
    let of = |is_meant: &dyn Fn(&SetRoom) -> bool| {
        let names =
            rooms.iter().filter(|room| is_meant(room)).map(|room| format!("{} ({})", room.name, room.frames));
        names.collect::<Vec<_>>().join(", ")
    };
    let few = of(&|room| room.frames < FEW_FRAMES);
    if !few.is_empty() {
        advice.push(format!(
            "Too few frames of {few}: {FEW_FRAMES} are a start, {GOOD_FRAMES} from all corners are good."
        ));
    }
    let more = of(&|room| (FEW_FRAMES..GOOD_FRAMES).contains(&room.frames));
    if !more.is_empty() {
        advice.push(format!("More frames would help, from other corners and heights: {more}."));
    }
    let least = rooms.iter().map(|room| room.frames).min().unwrap_or_default();
    let uneven = of(&|room| room.frames > UNEVEN * least.max(1));
    if least > 0 && !uneven.is_empty() {
        advice.push(format!("Far more frames than of other rooms: {uneven}."));
    }
    let one_drive = of(&|room| room.drives.len() == 1 && room.frames >= FEW_FRAMES);
    if !one_drive.is_empty() {
        advice.push(format!(
            "Recorded only once: {one_drive}. A second drive at another time of day teaches most, and only with it \
             training can tell how well it will do."
        ));
    }
    if elsewhere.is_empty() && rooms.len() >= 2 {
        advice.push(format!(
            "Pictures of other places in {ELSEWHERE:?} help to tell places that are none of the rooms."
        ));
    }
    advice
}

#[cfg(test)]
mod tests {
    use super::*;
    use roomsight_protocol::sets::SetDrive;

    fn room(name: &str, drives: &[usize]) -> SetRoom {
        let drives: Vec<SetDrive> = drives
            .iter()
            .enumerate()
            .map(|(idx, &frames)| SetDrive { name: idx.to_string(), frames })
            .collect();
        SetRoom { name: name.to_owned(), frames: drives.iter().map(|drive| drive.frames).sum(), drives }
    }

    #[test]
    fn what_is_missing_is_named() {
        let told = |rooms: &[SetRoom]| advice(rooms).join("\n");
        assert!(told(&[]).contains("two rooms"));
        assert!(told(&[room("hall", &[50])]).contains("one other room"));
        let few = told(&[room("hall", &[5]), room("kitchen", &[60, 60])]);
        assert!(
            few.contains("Too few frames of hall (5)")
                && few.contains("Far more frames than of other rooms: kitchen"),
            "{few}"
        );
        let once = told(&[room("hall", &[50]), room("kitchen", &[60, 60])]);
        assert!(once.contains("Recorded only once: hall (50)"), "{once}");
        assert!(once.contains("elsewhere"));
        assert_eq!(
            advice(&[room("hall", &[50, 50]), room("kitchen", &[60, 60]), room("elsewhere", &[3])]),
            Vec::<String>::new()
        );
    }
}
