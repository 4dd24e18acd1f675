//! A `frames.csv` manifest: the columns `file,place,sequence,camera,split`, found by name.
//!
//! `file` is relative to the manifest. Only `file` and `place`, the room, must be there; other columns are
//! ignored. A row with an empty place is counted as unlabeled. The camera defaults to perspective.
//!
//! Columns are separated as the headings are: by commas, semicolons or tabs. Headings and cameras may be
//! written in capitals, fields in quotes (also after spaces), paths with backslashes. Lines that begin with `#`,
//! empty rows, and the line `sep=;` of spreadsheets are passed over.

use super::{CAMERAS, Dataset, DatasetError, Format, Frame, Problem, camera_name, error, files};
use csv::StringRecord;
use icu_normalizer::{ComposingNormalizerBorrowed, DecomposingNormalizerBorrowed};
use roomsight_vision::camera::CameraKind;
use std::collections::{BTreeSet, HashMap};
use std::path::{Component, Path, PathBuf};
use std::{fs, io};

/// The name of the manifest in the folder of its data set.
const FILE_NAME: &str = "frames.csv";

/// What may separate columns, the most usual first.
const DELIMITERS: [u8; 3] = [b',', b';', b'\t'];

/// Whether a file has the name of a manifest, in whatever case.
pub fn is_called_so(path: &Path) -> bool {
    files::name(path).eq_ignore_ascii_case(FILE_NAME)
}

/// The manifest in a folder. Where several differ in case alone the one in lower case is taken.
pub fn find(folder: &Path) -> io::Result<Option<PathBuf>> {
    let entries = fs::read_dir(folder)?.collect::<io::Result<Vec<_>>>()?;
    let paths = entries.iter().map(fs::DirEntry::path);
    Ok(paths.filter(|path| is_called_so(path) && path.is_file()).max())
}

/// Reads the manifest at `path`. A listed file that does not exist is a problem.
pub fn read(path: &Path) -> Result<Dataset, DatasetError> {
    let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
    if extension != "csv" && extension != "tsv" {
        let why = "it is a file: give a folder, or a list of frames named *.csv or *.tsv".to_owned();
        return Err(DatasetError::UnknownLayout { path: path.to_owned(), why });
    }
    let mut dataset = parse(&files::read_labels(path).map_err(DatasetError::Manifest)?, path)?;
    for mut frame in std::mem::take(&mut dataset.frames) {
        match found(&frame.path) {
            Ok(path) => {
                frame.path = path;
                dataset.frames.push(frame);
            }
            Err(reason) => dataset.problems.push(Problem::new(&frame.path, reason)),
        }
    }
    Ok(dataset)
}

/// The path as the file system has it: letters may be composed otherwise there.
fn found(path: &Path) -> Result<PathBuf, &'static str> {
    let text = path.to_string_lossy();
    let composed = ComposingNormalizerBorrowed::new_nfc().normalize(&text);
    let decomposed = DecomposingNormalizerBorrowed::new_nfd().normalize(&text);
    let candidates = [path, Path::new(composed.as_ref()), Path::new(decomposed.as_ref())];
    match candidates.into_iter().find_map(|path| Some((path, fs::metadata(path).ok()?))) {
        Some((path, metadata)) if metadata.is_file() => Ok(path.to_owned()),
        Some(_) => Err("listed in the manifest, but it is no file"),
        None => Err("listed in the manifest, but there is no such file"),
    }
}

/// Parses the text of the manifest at `path`. Each row that is not empty becomes a frame, a problem, or
/// unlabeled.
fn parse(text: &str, path: &Path) -> Result<Dataset, DatasetError> {
    let mut dataset = Dataset::new(path, Format::Manifest);
    let delimiter = delimiter(text, &COLUMNS);
    let text = without_spaces_before_quotes(text, delimiter);
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(delimiter)
        .comment(Some(b'#'))
        .flexible(true)
        .has_headers(false)
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let mut records = reader.records().filter(|record| !record.as_ref().is_ok_and(is_empty));
    let headings = records.find(|record| !record.as_ref().is_ok_and(is_separator_line)).transpose();
    let headings = headings.map_err(|error| DatasetError::Manifest(Problem::new(path, error.to_string())))?;
    let headings = headings.unwrap_or_default();
    let columns = Columns::find(&headings).map_err(|fault| {
        let (path, line) = (path.to_owned(), line_of_record(&headings, &text));
        DatasetError::Columns { path, line, fault }
    })?;
    let mut line_of: HashMap<PathBuf, (u64, String)> = HashMap::new();
    for record in records {
        let record = match record {
            Ok(record) => record,
            Err(error) => {
                dataset.report(path, error.to_string());
                continue;
            }
        };
        let line = line_of_record(&record, &text);
        let problem = |reason: &str| Problem::new(path, reason).at(line);
        let row = match columns.row(&record) {
            Ok(row) => row,
            Err(reason) => {
                dataset.problems.push(problem(reason));
                continue;
            }
        };
        let frame = frame(&row, path, line)?;
        if let Some((first, room)) = line_of.get(&frame.path) {
            let problem = if *room == frame.room {
                problem("its file is listed a second time").with(format!("as in line {first}"))
            } else {
                let detail = format!("`{}`, and `{room}` in line {first}", frame.room);
                problem("its file is listed a second time, as another room").with(detail)
            };
            dataset.problems.push(problem);
            continue;
        }
        line_of.insert(frame.path.clone(), (line, frame.room.clone()));
        if frame.room.is_empty() { dataset.unlabeled.push(frame) } else { dataset.frames.push(frame) }
    }
    Ok(dataset)
}

fn is_empty(record: &StringRecord) -> bool {
    record.iter().all(str::is_empty)
}

/// Excel's `sep=;`, which is cut at its own delimiter.
fn is_separator_line(record: &StringRecord) -> bool {
    record.get(0).is_some_and(|first| first.eq_ignore_ascii_case("sep="))
}

/// The line of a record of `text`, counted from 1. A record's position is where the one before it ends: lines
/// that are passed over may lie between.
fn line_of_record(record: &StringRecord, text: &str) -> u64 {
    let Some(position) = record.position() else { return 1 };
    let rest = text.get(position.byte() as usize..).unwrap_or_default();
    let is_passed_over = |line: &&str| line.trim_end_matches('\r').is_empty() || line.starts_with('#');
    position.line() + rest.split('\n').take_while(is_passed_over).count() as u64
}

/// What separates the headings: the delimiter that cuts out the most columns that are looked for.
pub(super) fn delimiter(text: &str, columns: &[&str]) -> u8 {
    let is_passed_over = |line: &&str| line.is_empty() || line.starts_with('#');
    let mut lines =
        text.split(['\n', '\r']).map(|line| line.trim_matches(' ')).filter(|line| !is_passed_over(line));
    let first = lines.next().unwrap_or_default();
    if let [b's' | b'S', b'e' | b'E', b'p' | b'P', b'=', delimiter] = *first.as_bytes()
        && DELIMITERS.contains(&delimiter)
    {
        return delimiter;
    }
    let n_columns = |delimiter: u8| {
        let headings = first.split(char::from(delimiter)).map(|heading| heading.trim().trim_matches('"'));
        headings
            .filter(|heading| columns.iter().any(|column| heading.trim().eq_ignore_ascii_case(column)))
            .count()
    };
    // The first of equals.
    DELIMITERS.into_iter().rev().max_by_key(|&delimiter| n_columns(delimiter)).unwrap_or(b',')
}

/// A quote counts only as the first character of a field: where people write spaces before it, they go.
fn without_spaces_before_quotes(text: &str, delimiter: u8) -> String {
    let mut out = String::with_capacity(text.len());
    // Whether only spaces were seen of the field, and where they begin in `out`.
    let mut field_start = Some(0);
    let mut is_quoted = false;
    let mut began_quoted = false;
    let mut is_comment = text.starts_with('#');
    let mut characters = text.chars().peekable();
    while let Some(character) = characters.next() {
        let ends_line = !is_quoted && matches!(character, '\n' | '\r');
        if is_quoted {
            is_quoted = character != '"';
        } else if ends_line || (!is_comment && character == char::from(delimiter)) {
            (field_start, began_quoted) = (Some(out.len() + 1), false);
        } else if is_comment {
            // Its quotes mean nothing.
        } else if character == '"' {
            if let Some(start) = field_start.take() {
                out.truncate(start);
                (is_quoted, began_quoted) = (true, true);
            } else if began_quoted && out.ends_with('"') {
                // Two quotes in a quoted field stand for one.
                is_quoted = true;
            }
        } else if character != ' ' && character != '\t' {
            field_start = None;
        }
        if ends_line {
            is_comment = characters.peek() == Some(&'#');
        }
        out.push(character);
    }
    out
}

/// The columns that are read.
const COLUMNS: [&str; 5] = ["file", "place", "sequence", "camera", "split"];

/// Where the columns are.
struct Columns {
    file: usize,
    room: usize,
    sequence: Option<usize>,
    camera: Option<usize>,
    split: Option<usize>,
    n_columns: usize,
}

/// The fields of a row, which may be empty but for the file.
struct Row<'a> {
    file: &'a str,
    room: &'a str,
    sequence: &'a str,
    camera: &'a str,
    split: &'a str,
}

impl Columns {
    fn find(headings: &StringRecord) -> Result<Self, String> {
        let fail = |n_columns: &str, column: &str| {
            let found: BTreeSet<&str> = headings.iter().collect();
            format!("{n_columns} `{column}` among {}", error::enumerate(&found))
        };
        let find = |column: &'static str| {
            let mut found = (0..headings.len()).filter(|&idx| headings[idx].eq_ignore_ascii_case(column));
            let idx = found.next();
            if found.next().is_some() { Err(fail("two columns", column)) } else { Ok(idx) }
        };
        let need = |column| find(column)?.ok_or_else(|| fail("no column", column));
        Ok(Self {
            file: need("file")?,
            room: need("place")?,
            sequence: find("sequence")?,
            camera: find("camera")?,
            split: find("split")?,
            n_columns: headings.len(),
        })
    }

    /// The fields of a row that is not empty, or what is wrong with it.
    fn row<'r>(&self, record: &'r StringRecord) -> Result<Row<'r>, &'static str> {
        let get = |idx: Option<usize>| idx.and_then(|idx| record.get(idx)).unwrap_or_default();
        let row = Row {
            file: get(Some(self.file)),
            room: get(Some(self.room)),
            sequence: get(self.sequence),
            camera: get(self.camera),
            split: get(self.split),
        };
        if record.iter().any(|field| field.contains(['\n', '\r']) && field.len() > MAX_FIELD_BYTES)
            || [row.file, row.room, row.sequence].iter().any(|field| field.contains(['\n', '\r']))
        {
            Err(
                "a quote that is opened here is not closed in its line: all lines up to the next quote are left out",
            )
        } else if record.iter().skip(self.n_columns).any(|field| !field.is_empty()) {
            Err("more fields than headings: a field that holds the delimiter must be in quotes")
        } else if row.file.is_empty() {
            Err("names no file")
        } else if record.len() <= self.room {
            Err("ends before the column place")
        } else {
            Ok(row)
        }
    }
}

/// A field of several lines, such as a remark in a column that is not read, has at most so many bytes.
const MAX_FIELD_BYTES: usize = 4096;

/// The file that a row names, below the folder of the list. Where it does not lie there as it is written, the
/// whole path of the folder may come first, and backslashes may separate.
fn inside(file: &str, folder: &Path) -> Option<PathBuf> {
    let literal = Path::new(file);
    let slashed = PathBuf::from(file.replace('\\', "/"));
    let whole = slashed.is_absolute().then(|| fs::canonicalize(folder).ok()).flatten();
    let stripped = slashed.strip_prefix(whole.as_deref().unwrap_or(folder));
    let file = match stripped {
        _ if literal.is_relative() && folder.join(literal).exists() => literal,
        Ok(stripped) => stripped,
        Err(_) => slashed.strip_prefix(folder).unwrap_or(&slashed),
    };
    let is_inside = |part: Component| matches!(part, Component::Normal(_) | Component::CurDir);
    // Without `./` in between, so that a file has one name.
    let plain = file.components().filter(|part| matches!(part, Component::Normal(_))).collect();
    file.components().all(is_inside).then_some(plain)
}

fn frame(row: &Row, path: &Path, line: u64) -> Result<Frame, DatasetError> {
    let Some(file) = inside(row.file, path.parent().unwrap_or(Path::new(""))) else {
        return Err(DatasetError::Escape { path: path.to_owned(), line, file: row.file.to_owned() });
    };
    let camera = match row.camera {
        "" => Some(CameraKind::Perspective),
        name => CAMERAS.into_iter().find(|&camera| camera_name(camera).eq_ignore_ascii_case(name)),
    };
    let Some(camera) = camera else {
        let name = row.camera.to_owned();
        return Err(DatasetError::UnknownCamera { path: path.to_owned(), line, name });
    };
    Ok(Frame {
        path: path.with_file_name(file),
        room: row.room.to_owned(),
        sequence: row.sequence.to_owned(),
        camera,
        split: row.split.to_owned(),
        time: None,
        pose: None,
        odometry: None,
        scan: None,
        recorded: None,
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
        assert_eq!((frame.room.as_str(), frame.sequence.as_str(), frame.split.as_str()), ("kitchen", "", ""));
        assert_eq!(frame.camera, CameraKind::Omnidirectional);
        assert!(dataset.problems.is_empty());
    }

    #[test]
    fn a_row_becomes_a_frame_a_problem_or_unlabeled() {
        let rows = "1.jpg,kitchen\n2.jpg,\n,kitchen\n1.jpg,hall\n3.jpg,hall,extra\n4.jpg,hall,\n./4.jpg,hall\n\n,,\n5.jpg\n";
        let dataset = parsed(&format!("file,place\n{rows}")).unwrap();
        assert_eq!(dataset.frames.len(), 2);
        assert_eq!(dataset.unlabeled.len(), 1);
        let problems: Vec<String> = dataset.problems.iter().map(ToString::to_string).collect();
        let expected = [
            "set/frames.csv, line 4: names no file",
            "set/frames.csv, line 5: its file is listed a second time, as another room (`hall`, and `kitchen` in line 2)",
            "set/frames.csv, line 6: more fields than headings: a field that holds the delimiter must be in quotes",
            "set/frames.csv, line 8: its file is listed a second time (as in line 7)",
            "set/frames.csv, line 11: ends before the column place",
        ];
        assert_eq!(problems, expected);
    }

    #[test]
    fn lines_are_counted_over_those_passed_over() {
        let text = "# a\r\n\r\nfile,place\r\n#b\r\n\r\n1.jpg\r\n2.jpg,hall\r\n3.jpg\r\n";
        for text in [text.to_owned(), text.replace('\r', "")] {
            let lines: Vec<_> = parsed(&text).unwrap().problems.iter().map(|problem| problem.line).collect();
            assert_eq!(lines, [Some(6), Some(8)], "{text:?}");
        }
    }

    /// `file:room` of each frame; there must be no problem.
    fn labels(text: &str) -> Vec<String> {
        let dataset = parsed(text).unwrap();
        assert_eq!(dataset.problems, [], "{text}");
        let label = |frame: &Frame| {
            let file = frame.path.strip_prefix("set").unwrap().display();
            format!("{file}:{}", frame.room)
        };
        dataset.frames.iter().map(label).collect()
    }

    #[test]
    fn lists_are_read_as_spreadsheets_and_people_write_them() {
        let expected = ["a/1.jpg:living room, blue", "b/2.jpg:hall"];
        for text in [
            "file,place\na/1.jpg,\"living room, blue\"\nb/2.jpg,hall\n",
            "file, place\na/1.jpg, \"living room, blue\"\nb/2.jpg, \"hall\" \n",
            "File;Place;\r\na/1.jpg;living room, blue;\r\nb/2.jpg;hall;\r\n;;\r\n",
            "PLACE\tFILE\nliving room, blue\ta/1.jpg\nhall\tb/2.jpg",
            "sep=;\n\"file\";\"place\"\na/1.jpg;living room, blue\nb/2.jpg;hall\n",
            "sep=,\nfile,place\na/1.jpg,\"living room, blue\"\nb/2.jpg,hall\n",
            "# made by hand\n\nplace,file\n\"living room, blue\",a\\1.jpg\n#c,c\nhall,.\\b\\2.jpg\n",
            "file,place,note\nset/a/1.jpg,\"living room, blue\",\"two\nlines\"\nb/2.jpg,hall,\n",
        ] {
            assert_eq!(labels(text), expected, "{text}");
        }
        assert_eq!(labels("file,place\n1.jpg, \"the \"\"blue\"\" room\"\n"), ["1.jpg:the \"blue\" room"]);
        assert_eq!(labels("file,place\n1.jpg,17\" rack\n2.jpg,hall\n"), ["1.jpg:17\" rack", "2.jpg:hall"]);
        assert_eq!(labels("file,place,camera\n1.jpg,hall,Perspective\n"), ["1.jpg:hall"]);
    }

    #[test]
    fn a_quote_that_is_not_closed_is_told_with_its_line() {
        let dataset = parsed("file,place\n1.jpg,hall\n2.jpg,\"hall\n3.jpg,hall\n").unwrap();
        assert_eq!(dataset.frames.len(), 1);
        let problem = dataset.problems[0].to_string();
        assert!(problem.starts_with("set/frames.csv, line 3: a quote"), "{problem}");
    }

    #[test]
    fn quotes_that_quote_nothing_are_passed_over() {
        let in_comment = "# by Ann, \"the boss\nfile,place\n1.jpg, \"hall\"\n2.jpg, \"kitchen\"\n";
        assert_eq!(labels(in_comment), ["1.jpg:hall", "2.jpg:kitchen"]);
        let inches = "file,note,place\n1.jpg, 6\"\" lens, \"hall\"\n2.jpg, none, \"kitchen\"\n";
        assert_eq!(labels(inches), ["1.jpg:hall", "2.jpg:kitchen"]);
        assert_eq!(labels("sep=\t\nfile\tplace\n1.jpg\thall\n"), ["1.jpg:hall"]);
    }

    #[test]
    fn what_is_wrong_with_the_whole_is_named() {
        let error = |text: &str| parsed(text).unwrap_err().to_string();
        let columns = error("# rooms\nfile,room\n1.jpg,hall");
        assert!(columns.contains("line 2: no column `place` among file, room; "), "{columns}");
        assert!(columns.contains("semicolons or tabs"), "{columns}");
        assert!(error("file|place\n1.jpg|hall").contains("no column `file` among file|place"));
        assert!(error("file,place,Place\n1.jpg,hall,bath").contains("two columns `place`"));
        assert!(error("# nothing").contains("no column `file` among none"));
        assert!(error("file,place\n..\\1.jpg,hall").contains("leads out"));
        assert!(error("file,place,camera\n1.jpg,hall,fisheye").contains("line 2: no camera `fisheye`"));
        assert!(error("file,place\n1.jpg,hall\n../1.jpg,hall").contains("line 3: `../1.jpg` leads out"));
        assert!(error("file,place\na/../../1.jpg,hall").contains("leads out"));
        assert!(error("file,place\n/etc/1.jpg,hall").contains("leads out"));
    }

    proptest! {
        #[test]
        fn no_text_panics(text in "(file[,;\t]place\n)?\\PC{0,80}(\n(\\PC|[\",;\t\r\\\\]){0,40}){0,5}") {
            let _ = parsed(&text);
        }

        #[test]
        fn no_row_is_lost(
            rows in proptest::collection::vec("[a-c./\\\\ ]{0,6}(\t[a-c,;. ]{0,6}){0,2}", 0..20),
            delimiter in 0..3usize,
        ) {
            let delimiter = char::from(DELIMITERS[delimiter]);
            let rows: Vec<String> = rows.iter().map(|row| row.replace([',', ';'], "").replace('\t', &delimiter.to_string())).collect();
            let dataset = parsed(&format!("file{delimiter}place\n{}", rows.join("\n")));
            if let Ok(dataset) = dataset {
                let n_rows = dataset.frames.len() + dataset.problems.len() + dataset.unlabeled.len();
                let is_empty = |row: &&String| row.chars().all(|character| character == ' ' || character == delimiter);
                prop_assert_eq!(n_rows, rows.iter().filter(|row| !is_empty(row)).count());
            }
        }

        #[test]
        fn names_in_quotes_are_read_back(name in "[a-z,;\" ]{0,8}[a-z]", spaces in " {0,2}", delimiter in 0..3usize) {
            let delimiter = char::from(DELIMITERS[delimiter]);
            let quoted = name.replace('"', "\"\"");
            let text = format!("file{delimiter}place\n1.jpg{delimiter}{spaces}\"{quoted}\"{spaces}\n");
            prop_assert_eq!(labels(&text), [format!("1.jpg:{}", name.trim())]);
        }
    }
}
