//! `places.lst`: a frame and its room a line, `t<s>_x<m>_y<m>_a<rad>.jpeg LABEL`.
//!
//! Frames that were encoded anew have other endings than their lines: a frame is named by what comes before.

use super::Part;
use crate::dataset::files::is_picture_ending;
use crate::dataset::{Pose, Problem};
use std::collections::HashSet;
use std::path::Path;

/// One line of a `places.lst`.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelLine {
    /// The name of the image file, without its ending.
    pub frame: String,
    /// When the frame was taken, in seconds since 1970; from the name.
    pub time: f64,
    /// Where it was taken; from the name.
    pub pose: Pose,
    /// The readable name of the room, or the label as written when it is not known.
    pub place: String,
    /// Whether the label is one of COLD's.
    pub known: bool,
    /// The part of the lab, where the label names it.
    pub part: Option<Part>,
}

/// Parses the text of one `places.lst`; `path` is where it comes from, for the problems.
///
/// Each line that is not blank becomes either a label or a problem.
pub fn parse_places(text: &str, path: &Path) -> (Vec<LabelLine>, Vec<Problem>) {
    let mut lines = Vec::new();
    let mut problems = Vec::new();
    let mut frames_seen = HashSet::new();
    let problem = |line_idx: usize, reason| Problem::new(path, reason).at(line_idx as u64 + 1);
    for (line_idx, text) in text.lines().enumerate().filter(|(_, text)| !text.trim().is_empty()) {
        match parse_line(text) {
            Ok(line) if frames_seen.insert(line.frame.clone()) => lines.push(line),
            Ok(_) => problems.push(problem(line_idx, "its frame is labeled a second time")),
            Err(reason) => problems.push(problem(line_idx, reason)),
        }
    }
    (lines, problems)
}

/// The name of a frame's file without the ending of a picture; `None` where it has no such ending.
pub(super) fn frame_name(file: &str) -> Option<&str> {
    let (frame, ending) = file.rsplit_once('.')?;
    is_picture_ending(ending).then_some(frame)
}

/// COLD's labels. The papers use BR for what the files call TL.
const PLACES: [(&str, &str); 16] = [
    ("CR", "corridor"),
    ("TR", "terminal room"),
    ("RL", "robotics lab"),
    ("1PO", "one-person office"),
    ("2PO", "two-person office"),
    ("2PO1", "two-person office 1"),
    ("2PO2", "two-person office 2"),
    ("CNR", "conference room"),
    ("PA", "printer area"),
    ("KT", "kitchen"),
    ("BR", "bathroom"),
    ("TL", "bathroom"),
    ("LO", "large office"),
    ("ST", "stairs area"),
    ("SA", "stairs area"),
    ("LAB", "laboratory"),
];

fn parse_line(text: &str) -> Result<LabelLine, &'static str> {
    let mut tokens = text.split_whitespace();
    let (Some(file), Some(label), None) = (tokens.next(), tokens.next(), tokens.next()) else {
        return Err("not a file name and a label");
    };
    let named = frame_name(file).and_then(|frame| Some((frame, parse_frame_name(frame)?)));
    let (frame, (time, pose)) = named.ok_or("the file name is not t<s>_x<m>_y<m>_a<rad>.jpeg")?;
    let (room, part) = match label.rsplit_once('-') {
        Some((room, "A")) => (room, Some(Part::A)),
        Some((room, "B")) => (room, Some(Part::B)),
        _ => (label, None),
    };
    let known = PLACES.iter().find(|(token, _)| *token == room);
    let place = known.map_or(label, |(_, place)| place).to_owned();
    Ok(LabelLine { frame: frame.to_owned(), time, pose, place, known: known.is_some(), part })
}

fn parse_frame_name(frame: &str) -> Option<(f64, Pose)> {
    let mut fields = frame.split('_');
    let mut number = |prefix: char| -> Option<f64> {
        let value: f64 = fields.next()?.strip_prefix(prefix)?.parse().ok()?;
        value.is_finite().then_some(value)
    };
    let time = number('t')?;
    let pose = Pose { x: number('x')?, y: number('y')?, angle: number('a')? };
    fields.next().is_none().then_some((time, pose))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn parse(text: &str) -> (Vec<LabelLine>, Vec<Problem>) {
        parse_places(text, Path::new("places.lst"))
    }

    #[test]
    fn a_line_gives_time_pose_room_and_part() {
        let (lines, problems) = parse("t1152214411.174715_x0.21_y-1_a-0.5.jpeg 2PO1-A\r\n");
        assert_eq!(problems, []);
        let expected = LabelLine {
            frame: "t1152214411.174715_x0.21_y-1_a-0.5".into(),
            time: 1_152_214_411.174_715,
            pose: Pose { x: 0.21, y: -1.0, angle: -0.5 },
            place: "two-person office 1".into(),
            known: true,
            part: Some(Part::A),
        };
        assert_eq!(lines, [expected]);
    }

    #[test]
    fn labels_are_whole_tokens() {
        let place = |label: &str| {
            let (lines, _) = parse(&format!("t1_x0_y0_a0.jpeg {label}"));
            (lines[0].place.clone(), lines[0].known, lines[0].part)
        };
        assert_eq!(place("2PO"), ("two-person office".into(), true, None));
        assert_eq!(place("TL-B"), ("bathroom".into(), true, Some(Part::B)));
        assert_eq!(place("CRX"), ("CRX".into(), false, None));
        assert_eq!(place("2PO3-B"), ("2PO3-B".into(), false, Some(Part::B)));
        assert_eq!(place("CR-C"), ("CR-C".into(), false, None));
        assert_eq!(place("-A"), ("-A".into(), false, Some(Part::A)));
    }

    #[test]
    fn malformed_lines_are_problems_with_their_number() {
        let good = "t1_x0_y0_a0.jpeg CR";
        let names = [
            "t1_x0_y0.jpeg",
            "t1_x0_y0_a0.txt",
            "t1_x0_y0_a0",
            "tnan_x0_y0_a0.jpeg",
            "t1_x0_y0_ainf.jpeg",
            "t1_x0_y0_a0_b0.jpeg",
        ];
        for bad in names
            .map(|name| format!("{name} CR"))
            .iter()
            .chain(&["t1_x0_y0_a0.jpeg".into(), format!("{good} A")])
        {
            let (lines, problems) = parse(&format!("{good}\n\n{bad}\n"));
            assert_eq!(lines.len(), 1, "{bad}");
            assert_eq!(problems[0].line, Some(3), "{bad}: {problems:?}");
        }
        let (_, problems) = parse(&format!("{good}\nt1_x0_y0_a0.PNG KT\n"));
        assert_eq!(problems[0].to_string(), "places.lst, line 2: its frame is labeled a second time");
    }

    proptest! {
        #[test]
        fn every_line_is_a_label_or_a_problem(
            text in "((t[0-9.]{1,4}_x[0-9]_y-?[0-9]_a[0-9.]{1,3}\\.jpeg)? ?\\PC{0,12}[\n\r]{0,2}){0,12}"
        ) {
            let n_lines = text.lines().filter(|line| !line.trim().is_empty()).count();
            let (lines, problems) = parse(&text);
            prop_assert_eq!(lines.len() + problems.len(), n_lines);
        }
    }
}
