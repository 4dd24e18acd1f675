//! The rules for Prometheus speak when they should. Skipped, and said so, where promtool is not installed.

use std::process::Command;

const HOUSE: &str = env!("CARGO_MANIFEST_DIR");

fn promtool(args: &[&str]) -> Option<String> {
    let output = match Command::new("promtool").args(args).current_dir(HOUSE).output() {
        Ok(output) => output,
        Err(error) => {
            eprintln!(
                "LEFT OUT: the rules for Prometheus. promtool, of Debian's package prometheus: {error}."
            );
            return None;
        }
    };
    let text = [output.stdout, output.stderr].concat();
    let text = String::from_utf8_lossy(&text).into_owned();
    assert!(output.status.success(), "{text}");
    Some(text)
}

#[test]
fn rules_speak_and_are_quiet_as_they_should() {
    let Some(checked) = promtool(&["check", "rules", "docs/alerts.yml"]) else { return };
    let rules = std::fs::read_to_string(format!("{HOUSE}/docs/alerts.yml")).unwrap();
    let tests = std::fs::read_to_string(format!("{HOUSE}/tests/alerts/alerts_test.yml")).unwrap();
    let names: Vec<&str> =
        rules.lines().filter_map(|line| line.trim_start().strip_prefix("- alert: ")).collect();
    assert!(checked.contains(&format!("{} rules found", names.len())), "{checked}");
    for name in names {
        for case in ["speaks", "is quiet"] {
            assert!(tests.contains(&format!("name: {name} {case}\n")), "no test says when {name} {case}");
        }
    }
    promtool(&["test", "rules", "tests/alerts/alerts_test.yml"]);
}
