use super::*;

fn map(pairs: &[(&str, &str)]) -> HashMap<String, String> {
    pairs.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect()
}

fn file(text: &str) -> tempfile::NamedTempFile {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), text).unwrap();
    file
}

#[test]
fn flags_beat_the_environment_that_beats_the_file_that_beats_the_defaults() {
    let file = file("queue = 10\nthreads = 3\nmax_connections = 7\n");
    let environment = map(&[("ROOMSIGHT_QUEUE", "20"), ("ROOMSIGHT_THREADS", "4")]);
    let settings = Settings::load(Some(file.path()), environment, map(&[("queue", "30")])).unwrap();
    assert_eq!((settings.queue, settings.threads, settings.max_connections), (30, 4, 7));
    assert_eq!(settings.max_batch_frames, Settings::default().max_batch_frames);
}

#[test]
fn an_unknown_key_in_the_file_is_named() {
    let file = file("quue = 10\n");
    let error = Settings::load(Some(file.path()), map(&[]), map(&[])).unwrap_err().to_string();
    assert!(error.contains("quue"), "{error}");
}

#[test]
fn a_mistake_in_the_file_is_told_with_its_line() {
    for (text, line) in
        [("queue = 3\n\nquue = 10\n", 3), ("queue = 3\nthreads = \"a\"\n", 2), ("queue = [\n", 1)]
    {
        let file = file(text);
        let error = Settings::load(Some(file.path()), map(&[]), map(&[])).unwrap_err().to_string();
        assert!(error.contains(&format!("{}, line {line}: ", file.path().display())), "{text:?}: {error}");
    }
    let file = file("queue = \"300\"\n");
    assert_eq!(
        Settings::load(Some(file.path()), map(&[]), map(&[])).unwrap().queue,
        300,
        "what layers take stays"
    );
}

#[test]
fn a_missing_file_is_named() {
    let error = Settings::load(Some(Path::new("/no/such.toml")), map(&[]), map(&[])).unwrap_err();
    assert!(error.to_string().contains("/no/such.toml"), "{error}");
}

#[test]
fn foreign_names_in_the_environment_are_no_settings() {
    let environment = map(&[("ROOMSIGHT_PORT", "tcp://10.0.0.1:80"), ("QUEUE", "9"), ("PATH", "/bin")]);
    let settings = Settings::load(None, environment, map(&[])).unwrap();
    assert_eq!(settings.queue, Settings::default().queue);
}

#[test]
fn keys_come_from_the_environment_and_are_not_printed() {
    let (hash, other) = ("ab".repeat(32), "cd".repeat(32));
    let keys = format!("robot:wall-e:{hash},viewer:screen:{other}");
    let settings = Settings::load(None, map(&[("ROOMSIGHT_KEYS", &keys)]), map(&[])).unwrap();
    let printed = settings.to_toml().unwrap();
    assert_eq!(settings.keys.len(), 2);
    assert!(printed.contains("robot:wall-e:") && printed.contains("viewer:screen:"), "{printed}");
    assert!(!printed.contains(&hash) && !printed.contains(&other), "{printed}");
    assert!(!format!("{settings:?}").contains(&hash));
}

#[test]
fn lists_come_from_the_environment_by_commas() {
    let environment = map(&[("ROOMSIGHT_HOSTS", "lab,lab.example:80"), ("ROOMSIGHT_ORIGINS", "http://a")]);
    let settings = Settings::load(None, environment, map(&[])).unwrap();
    assert_eq!((settings.hosts.len(), settings.origins.len()), (2, 1));
}

#[test]
fn keys_of_one_name_are_refused() {
    let keys = format!("robot:a:{0},viewer:a:{0}", "ab".repeat(32));
    let error = Settings::load(None, map(&[("ROOMSIGHT_KEYS", &keys)]), map(&[])).unwrap_err().to_string();
    assert!(error.contains("keys") && error.contains("\"a\""), "{error}");
}

#[test]
fn what_is_printed_without_keys_can_be_read_again() {
    let file = file(&Settings::default().to_toml().unwrap());
    let settings = Settings::load(Some(file.path()), map(&[]), map(&[])).unwrap();
    assert_eq!(settings.to_toml().unwrap(), Settings::default().to_toml().unwrap());
}

#[test]
fn values_that_cannot_work_are_refused_by_name() {
    for (name, value) in [
        ("threads", "5000"),
        ("max_connections", "0"),
        ("max_model_bytes", "1073741825"),
        ("max_uploads", "0"),
        ("header_timeout_ms", "0"),
        ("body_timeout_ms", "0"),
        ("drain_timeout_ms", "0"),
        ("stream_idle_timeout_ms", "0"),
        ("stream_write_timeout_ms", "0"),
        ("max_batch_frames", "0"),
        ("max_buffered_bytes", "10"),
        ("max_streams_per_caller", "5000"),
        ("stream_message_timeout_ms", "0"),
        ("queue", "many"),
        ("caller_share", "0"),
        ("caller_share", "1.5"),
        ("write_timeout_ms", "0"),
        ("keys", "robot:wall-e:short"),
        ("hosts", "http://lab"),
        ("origins", "lab"),
        ("session_ms", "0"),
        ("resume_keys", "short"),
        ("resume_keys", &["0123456789abcdef0123456789abcdef"; 3].join(",")),
        ("log_format", "xml"),
        ("otlp_endpoint", "https://collector:4318"),
    ] {
        let error = Settings::load(None, map(&[]), map(&[(name, value)])).unwrap_err().to_string();
        assert!(error.contains(name), "{name}: {error}");
    }
}
