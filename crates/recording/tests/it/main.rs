//! Tests against recordings that other libraries wrote.

mod recordings;
