//! What is counted where, and that docs/ says so.

use super::catalog::{ALL, Metric, MetricKind};
use super::*;
use serde_json::Value;
use std::collections::BTreeSet;
use std::fs;

const DOCS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/docs");

/// The value of a series; 0 where there is none.
fn value(metrics: &Metrics, series: &str) -> f64 {
    let text = metrics.render();
    let value = text.lines().find_map(|line| line.strip_prefix(series)?.strip_prefix(' '));
    value.map_or(0.0, |value| value.parse().unwrap())
}

#[test]
fn swaps_are_counted_by_kind_and_outcome() {
    let metrics = Metrics::new().unwrap();
    metrics.swapped(SwapKind::Rollback, Duration::from_millis(300), SwapOutcome::Done);
    metrics.swapped(SwapKind::Rollback, Duration::from_millis(700), SwapOutcome::Done);
    metrics.swapped(SwapKind::Rollback, Duration::from_millis(700), SwapOutcome::Lost);
    let swaps = |kind, outcome| {
        value(&metrics, &format!(r#"roomsight_swaps_total{{kind="{kind}",outcome="{outcome}"}}"#))
    };
    assert_eq!([swaps("rollback", "done"), swaps("rollback", "lost")], [2.0, 1.0]);
    assert_eq!([swaps("rollback", "failed"), swaps("unload", "done")], [0.0, 0.0]);
    let bucket = |le| {
        value(&metrics, &format!(r#"roomsight_swap_duration_seconds_bucket{{kind="rollback",le="{le}"}}"#))
    };
    assert_eq!(["0.25", "0.5", "1", "+Inf"].map(bucket), [0.0, 1.0, 3.0, 3.0]);
}

#[test]
fn all_swaps_and_drops_are_told_before_the_first() {
    let text = Metrics::new().unwrap().render();
    for kind in SwapKind::ALL {
        for outcome in SwapOutcome::ALL {
            let labels = format!(r#"{{kind="{}",outcome="{}"}} 0"#, kind.name(), outcome.name());
            assert!(text.contains(&format!("roomsight_swaps_total{labels}")), "{text}");
        }
    }
    for reason in DROP_REASONS {
        // The name that travels is the one that is counted.
        let name = serde_json::to_value(reason).unwrap();
        assert!(text.contains(&format!("roomsight_frames_dropped_total{{reason={name}}} 0")), "{text}");
    }
}

#[test]
fn lost_events_and_drops_are_added_up() {
    let metrics = Metrics::new().unwrap();
    metrics.events_lost(5);
    metrics.events_lost(2);
    metrics.dropped(DropReason::Overload);
    assert_eq!(value(&metrics, "roomsight_events_lost_total"), 7.0);
    assert_eq!(value(&metrics, r#"roomsight_frames_dropped_total{reason="overload"}"#), 1.0);
}

#[test]
fn services_in_one_process_count_apart() {
    let (one, other) = (Metrics::new().unwrap(), Metrics::new().unwrap());
    one.events_lost(1);
    assert_eq!(value(&other, "roomsight_events_lost_total"), 0.0);
}

#[test]
fn sorting_loses_nothing() {
    let metrics = Metrics::new().unwrap();
    for _ in 0..3 {
        for _ in 0..1000 {
            let took = Duration::from_millis(3);
            metrics.answered(Answered { pattern: "/livez", method: "GET", status: 200, took });
        }
        metrics.recorder.sort();
    }
    assert_eq!(value(&metrics, r#"roomsight_request_duration_seconds_count{route="/livez"}"#), 3000.0);
}

/// Names end as Prometheus asks: with the unit, and counters with `_total`.
#[test]
fn names_tell_kind_and_unit() {
    for metric in ALL {
        let is_total = metric.name.ends_with("_total");
        assert_eq!(is_total, metric.kind == MetricKind::Counter, "{}", metric.name);
        if let MetricKind::Histogram(bounds) = metric.kind {
            let has_unit = ["_seconds", "_ratio"].iter().any(|unit| metric.name.ends_with(unit));
            assert!(has_unit && bounds.is_sorted(), "{}", metric.name);
        }
    }
    assert_eq!(ALL.iter().map(|metric| metric.name).collect::<BTreeSet<_>>().len(), ALL.len());
}

/// `UPDATE=1 cargo test --lib metrics` writes it anew.
#[test]
fn the_document_lists_all_metrics() {
    let path = format!("{DOCS}/METRICS.md");
    let file = fs::read_to_string(&path).unwrap_or_default();
    let (before, _) = file.split_once("\n| metric |").expect("the document has a table");
    let rows: Vec<String> = ALL.map(row).into();
    let expected =
        format!("{before}\n| metric | type | labels | what |\n|---|---|---|---|\n{}\n", rows.join("\n"));
    if std::env::var_os("UPDATE").is_some() {
        fs::write(&path, &expected).unwrap();
    }
    assert!(fs::read_to_string(&path).unwrap() == expected, "docs/METRICS.md is stale");
}

fn row(metric: &Metric) -> String {
    let labels: Vec<String> = metric.labels.iter().map(|label| format!("`{label}`")).collect();
    format!("| `{}` | {} | {} | {} |", metric.name, metric.kind.name(), labels.join(", "), metric.help)
}

/// Every word of a query is a documented metric, one of its labels, or PromQL.
#[test]
fn the_dashboard_and_the_alerts_ask_for_what_there_is() {
    let dashboard: Value =
        serde_json::from_str(&fs::read_to_string(format!("{DOCS}/grafana.json")).unwrap()).unwrap();
    let targets =
        dashboard["panels"].as_array().unwrap().iter().flat_map(|panel| panel["targets"].as_array());
    let queries = targets.flatten().map(|target| target["expr"].as_str().unwrap());
    let alerts = fs::read_to_string(format!("{DOCS}/alerts.yml")).unwrap();
    let conditions = alerts.split(" expr: ").skip(1).map(|after| {
        let end = after.find("labels: {severity").unwrap();
        after[..end].split("for: ").next().unwrap()
    });
    let queries: Vec<&str> = queries.chain(conditions).collect();
    assert!(queries.len() >= 30, "{queries:?}");
    for query in queries {
        assert_eq!(unknown_words(query), Vec::<&str>::new(), "{query}");
    }
    assert_eq!(unknown_words(r#"sum(rate(roomsight_robots{mood="good"}[1m]))"#), ["mood"]);
    assert_eq!(unknown_words("rate(roomsight_frames[1m])"), ["roomsight_frames"]);
    assert_eq!(unknown_words("rate(roomsight_frames_total_sum[1m])"), ["roomsight_frames_total_sum"]);
}

fn unknown_words(query: &str) -> Vec<&str> {
    const PROMQL: [&str; 13] = [
        "sum",
        "max",
        "by",
        "on",
        "unless",
        "rate",
        "increase",
        "histogram_quantile",
        "le",
        "__rate_interval",
        // What Prometheus adds to every series, and knows by itself.
        "instance",
        "job",
        "up",
    ];
    let of = |word: &str| ALL.into_iter().find(|metric| series_names(metric).any(|name| name == word));
    // Every second part is in quotes, and a number with its unit begins with a digit.
    let words: Vec<&str> = query
        .split('"')
        .step_by(2)
        .flat_map(|part| part.split(|c: char| !c.is_ascii_alphanumeric() && c != '_'))
        .filter(|word| word.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_'))
        .collect();
    let labels: Vec<&str> =
        words.iter().filter_map(|word| of(word)).flat_map(|metric| metric.labels).copied().collect();
    words
        .into_iter()
        .filter(|word| !PROMQL.contains(word) && !labels.contains(word) && of(word).is_none())
        .collect()
}

/// The names under which a metric's values come.
fn series_names(metric: &Metric) -> impl Iterator<Item = String> {
    let suffixes: &[&str] = match metric.kind {
        MetricKind::Histogram(_) => &["_bucket", "_sum", "_count"],
        MetricKind::Counter | MetricKind::Gauge => &[""],
    };
    suffixes.iter().map(move |suffix| format!("{}{suffix}", metric.name))
}
