//! A `frames.csv` manifest: the columns `file,place,sequence,camera,split`, found by name.
//!
//! `file` is relative to the manifest. Only `file` and `place` must be there; other columns are
//! ignored. A row with an empty place is counted as unlabeled. The camera defaults to perspective.

use super::{CAMERAS, Dataset, DatasetError, Format, Frame, Problem, camera_name, files};
use crate::camera::CameraKind;
use serde::Deserialize;
use std::collections::HashSet;
use std::path::{Component, Path};

/// The name of the manifest in the folder of its data set.
pub const FILE_NAME: &str = "frames.csv";

/// Reads the manifest at `path`. A listed file that does not exist is a problem.
pub fn read(path: &Path) -> Result<Dataset, DatasetError> {
    if !path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv")) {
        return Err(DatasetError::UnknownLayout(path.to_owned()));
    }
    let mut dataset = parse(&files::read_labels(path)?, path)?;
    let (frames, missing): (Vec<Frame>, Vec<Frame>) =
        dataset.frames.into_iter().partition(|frame| frame.path.is_file());
    dataset.frames = frames;
    let problem =
        |frame: Frame| Problem::new(&frame.path, "listed in the manifest, but there is no such file");
    dataset.problems.extend(missing.into_iter().map(problem));
    Ok(dataset)
}

#[derive(Deserialize)]
struct Row {
    file: String,
    place: String,
    #[serde(default)]
    sequence: String,
    #[serde(default)]
    camera: String,
    #[serde(default)]
    split: String,
}

/// Parses the text of the manifest at `path`. Each row becomes a frame, a problem, or unlabeled.
fn parse(text: &str, path: &Path) -> Result<Dataset, DatasetError> {
    let mut dataset = Dataset::new(path, Format::Manifest);
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(text.as_bytes());
    let columns = reader
        .headers()
        .map_err(|error| DatasetError::Labels { path: path.to_owned(), reason: error.to_string() })?
        .clone();
    for column in ["file", "place"] {
        if !columns.iter().any(|found| found == column) {
            return Err(DatasetError::MissingColumn { path: path.to_owned(), column });
        }
    }
    let mut files_seen = HashSet::new();
    for record in reader.records() {
        let record = match record {
            Ok(record) => record,
            Err(error) => {
                dataset.report(path, error.to_string());
                continue;
            }
        };
        let line = record.position().map_or(0, csv::Position::line);
        match record.deserialize::<Row>(Some(&columns)) {
            Err(error) => dataset.report(path, format!("line {line}: {error}")),
            Ok(row) if row.file.is_empty() => dataset.report(path, format!("line {line}: names no file")),
            Ok(row) if !files_seen.insert(row.file.clone()) => {
                dataset.report(path, format!("line {line}: `{}` is listed a second time", row.file));
            }
            Ok(row) if row.place.is_empty() => dataset.n_unlabeled += 1,
            Ok(row) => dataset.frames.push(frame(row, path, line)?),
        }
    }
    Ok(dataset)
}

fn frame(row: Row, path: &Path, line: u64) -> Result<Frame, DatasetError> {
    let inside = |part: Component| matches!(part, Component::Normal(_) | Component::CurDir);
    if !Path::new(&row.file).components().all(inside) {
        return Err(DatasetError::Escape { path: path.to_owned(), line, file: row.file });
    }
    let camera = match row.camera.as_str() {
        "" => Some(CameraKind::Perspective),
        name => CAMERAS.into_iter().find(|&camera| camera_name(camera) == name),
    };
    let Some(camera) = camera else {
        return Err(DatasetError::UnknownCamera { path: path.to_owned(), line, name: row.camera });
    };
    Ok(Frame {
        path: path.with_file_name(&row.file),
        place: row.place,
        sequence: row.sequence,
        camera,
        split: row.split,
        time: None,
        pose: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn parsed(text: &str) -> Result<Dataset, DatasetError> {
        parse(text, Path::new("set/frames.csv"))
    }

    #[test]
    fn columns_are_found_by_name() {
        let text = "\u{feff}place,weather,file,camera\r\nkitchen,rain,a/1.jpg,omnidirectional\r\n";
        let dataset = parsed(text).unwrap();
        let frame = &dataset.frames[0];
        assert_eq!(frame.path, Path::new("set/a/1.jpg"));
        assert_eq!(
            (frame.place.as_str(), frame.sequence.as_str(), frame.split.as_str()),
            ("kitchen", "", "")
        );
        assert_eq!(frame.camera, CameraKind::Omnidirectional);
        assert!(dataset.problems.is_empty());
    }

    #[test]
    fn a_row_becomes_a_frame_a_problem_or_unlabeled() {
        let rows = "1.jpg,kitchen\n2.jpg,\n,kitchen\n1.jpg,hall\n3.jpg,hall,extra\n4.jpg,hall\n";
        let dataset = parsed(&format!("file,place\n{rows}")).unwrap();
        assert_eq!(dataset.frames.len(), 2);
        assert_eq!(dataset.n_unlabeled, 1);
        let reasons: Vec<&str> = dataset.problems.iter().map(|problem| problem.reason.as_str()).collect();
        assert_eq!(reasons[0], "line 4: names no file");
        assert_eq!(reasons[1], "line 5: `1.jpg` is listed a second time");
        assert!(reasons[2].contains("line: 6"), "{}", reasons[2]);
    }

    #[test]
    fn what_is_wrong_with_the_whole_is_named() {
        let error = |text: &str| parsed(text).unwrap_err().to_string();
        assert!(error("file,room\n1.jpg,hall").contains("no column `place`"));
        assert!(error("file,place,camera\n1.jpg,hall,fisheye").contains("line 2: no camera `fisheye`"));
        assert!(error("file,place\n1.jpg,hall\n../1.jpg,hall").contains("line 3: `../1.jpg` leads out"));
        assert!(error("file,place\na/../../1.jpg,hall").contains("leads out"));
        assert!(error("file,place\n/etc/1.jpg,hall").contains("leads out"));
    }

    proptest! {
        #[test]
        fn no_text_panics(text in "(file,place\n)?\\PC{0,80}(\n\\PC{0,40}){0,5}") {
            let _ = parsed(&text);
        }

        #[test]
        fn no_row_is_lost(rows in proptest::collection::vec("[a-c,. ]{1,12}", 0..20)) {
            let dataset = parsed(&format!("file,place\n{}", rows.join("\n")));
            if let Ok(dataset) = dataset {
                let n_rows = dataset.frames.len() + dataset.problems.len() + dataset.n_unlabeled;
                prop_assert_eq!(n_rows, rows.len());
            }
        }
    }
}
