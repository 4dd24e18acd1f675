//! Traces: what a caller's header `traceparent` says (W3C Trace Context).

use axum::http::{HeaderMap, HeaderName};
use tracing::Span;

const HEADER: HeaderName = HeaderName::from_static("traceparent");

/// What a caller says of its own span.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(not(feature = "otlp"), allow(dead_code, reason = "a log names the trace alone"))]
pub struct TraceParent {
    trace_id: u128,
    span_id: u64,
    flags: u8,
}

impl TraceParent {
    /// Reads the header. One that is not as the standard says, or comes twice, is as good as none.
    pub fn of(headers: &HeaderMap) -> Option<Self> {
        let mut values = headers.get_all(HEADER).iter();
        match (values.next(), values.next()) {
            (Some(value), None) => Self::parse(value.to_str().ok()?),
            _ => None,
        }
    }

    /// Reads `VERSION-TRACE-SPAN-FLAGS`. Versions above 00 may have more after it.
    fn parse(text: &str) -> Option<Self> {
        let mut parts = text.split('-');
        let version = hexadecimal(parts.next()?, 2)?;
        let trace_id = hexadecimal(parts.next()?, 32)?;
        let span_id = hexadecimal(parts.next()?, 16)? as u64;
        let flags = hexadecimal(parts.next()?, 2)? as u8;
        let is_whole = version < 0xff && (version > 0 || parts.next().is_none());
        (is_whole && trace_id != 0 && span_id != 0).then_some(Self { trace_id, span_id, flags })
    }

    /// Makes a request's span a child of the caller's.
    pub fn adopt(self, span: &Span) {
        span.record("trace_id", format_args!("{:032x}", self.trace_id));
        #[cfg(feature = "otlp")]
        self.adopt_exported(span);
    }

    #[cfg(feature = "otlp")]
    fn adopt_exported(self, span: &Span) {
        use opentelemetry::Context;
        use opentelemetry::trace::{SpanContext, SpanId, TraceContextExt, TraceFlags, TraceId, TraceState};
        use tracing_opentelemetry::OpenTelemetrySpanExt;
        let parent = SpanContext::new(
            TraceId::from_bytes(self.trace_id.to_be_bytes()),
            SpanId::from_bytes(self.span_id.to_be_bytes()),
            TraceFlags::new(self.flags),
            true,
            TraceState::default(),
        );
        if let Err(error) = span.set_parent(Context::new().with_remote_span_context(parent)) {
            tracing::debug!(%error, "a request is not exported as a part of its caller's trace");
        }
    }
}

/// A number in exactly so many lowercase digits.
fn hexadecimal(text: &str, n_digits: usize) -> Option<u128> {
    let is_digit = |byte: u8| byte.is_ascii_digit() || (b'a'..=b'f').contains(&byte);
    let is_number = text.len() == n_digits && text.bytes().all(is_digit);
    is_number.then(|| u128::from_str_radix(text, 16).ok())?
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SAMPLE: &str = "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01";

    #[test]
    fn a_parent_is_read() {
        let parent = TraceParent::parse(SAMPLE).unwrap();
        assert_eq!(parent.trace_id, 0x0af7_6519_16cd_43dd_8448_eb21_1c80_319c);
        assert_eq!((parent.span_id, parent.flags), (0xb7ad_6b71_6920_3331, 1));
        let later = format!("cc{}-more-of-it", &SAMPLE[2..]);
        assert_eq!(TraceParent::parse(&later), Some(parent), "later versions may say more");
    }

    #[test]
    fn what_the_standard_forbids_is_no_parent() {
        for bad in [
            String::new(),
            SAMPLE.to_uppercase(),
            format!("{SAMPLE}-"),
            format!("{SAMPLE}-00"),
            format!(" {SAMPLE}"),
            format!("ff{}", &SAMPLE[2..]),
            format!("cc{}x", &SAMPLE[2..]),
            SAMPLE[..54].to_owned(),
            SAMPLE.replace("b7ad6b7169203331", "0000000000000000"),
            SAMPLE.replace("0af7651916cd43dd8448eb211c80319c", &"0".repeat(32)),
            SAMPLE.replace("0af7", "+af7"),
        ] {
            assert_eq!(TraceParent::parse(&bad), None, "{bad:?}");
        }
    }

    #[test]
    fn two_headers_are_none() {
        let headers = |n| HeaderMap::from_iter((0..n).map(|_| (HEADER, SAMPLE.parse().unwrap())));
        assert!(TraceParent::of(&headers(1)).is_some());
        assert_eq!(TraceParent::of(&HeaderMap::new()), None);
        let mut twice = headers(1);
        twice.append(HEADER, SAMPLE.parse().unwrap());
        assert_eq!(TraceParent::of(&twice), None);
    }

    proptest! {
        #[test]
        fn any_text_is_read_or_not(text in ".*", position in 0_usize..55, byte in any::<char>()) {
            let _ = TraceParent::parse(&text);
            let mut damaged: Vec<char> = SAMPLE.chars().collect();
            damaged[position] = byte;
            let _ = TraceParent::parse(&damaged.into_iter().collect::<String>());
        }
    }
}
