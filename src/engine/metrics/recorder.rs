//! The counters and histograms of one service, and the text form of all metrics.

use super::catalog::{ALL, Metric, MetricKind};
use metrics::{Counter, Histogram, Key, Label, Level, Metadata};
use metrics_exporter_prometheus::formatting::{write_help_line, write_metric_line, write_type_line};
use metrics_exporter_prometheus::{
    BuildError, LabelSet, Matcher, PrometheusBuilder, PrometheusHandle, PrometheusRecorder,
};

const METADATA: Metadata = Metadata::new(module_path!(), Level::INFO, None);

/// Counters and histograms. Each service has its own, so that several can live in one process.
pub struct Recorder {
    recorder: PrometheusRecorder,
    handle: PrometheusHandle,
}

impl Recorder {
    /// Knows all metrics of the catalog; nothing is counted yet.
    pub fn new() -> Result<Self, BuildError> {
        let mut builder = PrometheusBuilder::new();
        for metric in ALL {
            if let MetricKind::Histogram(buckets) = metric.kind {
                builder = builder.set_buckets_for_metric(Matcher::Full(metric.name.to_owned()), buckets)?;
            }
        }
        let recorder = builder.build_recorder();
        for metric in ALL {
            metrics::Recorder::describe_counter(&recorder, metric.name.into(), None, metric.help.into());
        }
        Ok(Self { handle: recorder.handle(), recorder })
    }

    /// A series of a counter, for these values of its labels; the same values give the same series.
    pub fn counter(&self, metric: &Metric, values: &[&str]) -> Counter {
        metrics::Recorder::register_counter(&self.recorder, &key(metric, values), &METADATA)
    }

    /// A series of a histogram, likewise.
    pub fn histogram(&self, metric: &Metric, values: &[&str]) -> Histogram {
        metrics::Recorder::register_histogram(&self.recorder, &key(metric, values), &METADATA)
    }

    /// What was counted, in Prometheus's text form.
    pub fn render(&self) -> String {
        self.handle.render()
    }

    /// Sorts what was recorded into buckets; until then each value is kept as it is.
    pub fn sort(&self) {
        self.handle.run_upkeep();
    }
}

/// Values that are read at the moment of a scrape, in Prometheus's text form.
#[derive(Default)]
pub struct Readings(String);

impl Readings {
    /// Adds a metric without labels.
    pub fn add(&mut self, metric: &Metric, value: f64) {
        self.add_series(metric, [([""; 0], value)]);
    }

    /// Adds a metric with its series, each with the values of its labels.
    pub fn add_series<S: AsRef<str>, const N: usize>(
        &mut self,
        metric: &Metric,
        series: impl IntoIterator<Item = ([S; N], f64)>,
    ) {
        let Self(text) = self;
        write_help_line(text, metric.name, None, None, metric.help);
        write_type_line(text, metric.name, None, None, metric.kind.name());
        for (values, value) in series {
            let labels = LabelSet::from_key_and_global(&key(metric, &values), &Default::default());
            write_metric_line::<&str, f64>(text, metric.name, None, &labels, None, value, None);
        }
        text.push('\n');
    }

    /// All that was added.
    pub fn into_text(self) -> String {
        self.0
    }
}

fn key(metric: &Metric, values: &[impl AsRef<str>]) -> Key {
    debug_assert_eq!(metric.labels.len(), values.len(), "{}", metric.name);
    let labels = metric.labels.iter().zip(values);
    let labels = labels.map(|(&name, value)| Label::new(name, value.as_ref().to_owned()));
    Key::from_parts(metric.name, labels.collect::<Vec<_>>())
}
