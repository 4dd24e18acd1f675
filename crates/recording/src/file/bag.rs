//! Bags of ROS 1, version 2.0 (<http://wiki.ros.org/Bags/Format/2.0>): by their index, or record after record where there is
//! none.

use super::blocks::{Blocks, MAX_BLOCK_BYTES, Packing, Unpacked};
use super::{BAG_MAGIC, Contents, ENDS_EARLY, Entry, Index, NO_INDEX, Place, Span, number_of};
use crate::error::{MessageError, RecordingError};
use crate::fields::Fields;
use crate::topic::{Encoding, Topic};
use std::collections::HashMap;
use std::path::Path;

/// What a record is.
const OP_MESSAGE: u8 = 2;
const OP_INDEX: u8 = 4;
const OP_CHUNK: u8 = 5;
const OP_CHUNK_INFO: u8 = 6;
const OP_CONNECTION: u8 = 7;

/// The longest header of a record, in bytes.
const MAX_HEADER_BYTES: u64 = 1 << 20;

/// A bag.
#[derive(Debug)]
pub(crate) struct BagFile {
    blocks: Blocks,
    /// By the number that the bag has for it.
    topic_of_connection: HashMap<u32, usize>,
    /// Where the chunks lie; none where the bag does not say, and is read record after record.
    chunks: Option<Vec<u64>>,
}

/// The named fields of a header.
struct Header<'a>(HashMap<&'a [u8], &'a [u8]>);

impl<'a> Header<'a> {
    fn read(bytes: &'a [u8]) -> Result<Self, MessageError> {
        let (mut fields, mut named) = (Fields::packed(bytes), HashMap::new());
        while !fields.rest().is_empty() {
            let field = fields.bytes()?;
            let equals = field.iter().position(|&byte| byte == b'=').ok_or(MessageError::Short)?;
            named.insert(&field[..equals], &field[equals + 1..]);
        }
        Ok(Self(named))
    }

    fn get(&self, name: &str) -> Result<Fields<'a>, MessageError> {
        self.0.get(name.as_bytes()).map(|bytes| Fields::packed(bytes)).ok_or(MessageError::Short)
    }

    fn text(&self, name: &str) -> Result<String, MessageError> {
        Ok(String::from_utf8_lossy(self.get(name)?.rest()).into_owned())
    }

    fn op(&self) -> Result<u8, MessageError> {
        self.get("op")?.u8()
    }
}

/// Where a record of a bag lies.
struct Record {
    header: Vec<u8>,
    /// Where its data begins.
    data: u64,
    n_bytes: u64,
}

impl Record {
    fn end(&self) -> u64 {
        self.data.saturating_add(self.n_bytes)
    }
}

/// What the end of a bag tells of it.
#[derive(Default)]
struct Summary {
    topics: Vec<Topic>,
    topic_of_connection: HashMap<u32, usize>,
    chunks: Vec<u64>,
    span: Option<Span>,
}

impl Summary {
    /// What a record of a connection says: its header and data.
    fn connection(&mut self, header: &Header, data: &[u8]) -> Result<(), MessageError> {
        let connection = header.get("conn")?.u32()?;
        let (name, type_name) = (header.text("topic")?, Header::read(data)?.text("type")?);
        let topic = Topic { name, type_name, encoding: Encoding::Ros1, n_messages: None };
        if !self.topic_of_connection.contains_key(&connection) {
            self.topic_of_connection.insert(connection, number_of(&mut self.topics, topic));
        }
        Ok(())
    }

    /// What a record of a chunk says, with its data: how many messages of each connection are in it.
    fn chunk(&mut self, header: &Header, data: &[u8]) -> Result<(), MessageError> {
        self.chunks.push(header.get("chunk_pos")?.u64()?);
        let mut counts = Fields::packed(data);
        let mut n_in_chunk = 0;
        while !counts.rest().is_empty() {
            let (connection, n_messages) = (counts.u32()?, u64::from(counts.u32()?));
            n_in_chunk += n_messages;
            if let Some(&topic_idx) = self.topic_of_connection.get(&connection) {
                *self.topics[topic_idx].n_messages.get_or_insert_default() += n_messages;
            }
        }
        let span = Span {
            first_ns: header.get("start_time")?.time_ns()?,
            last_ns: header.get("end_time")?.time_ns()?,
        };
        if n_in_chunk > 0 {
            self.span = Some(Span::with(self.span, span));
        }
        Ok(())
    }
}

impl BagFile {
    /// Opens a bag and finds what is in it.
    pub(super) fn open(path: &Path) -> Result<(Self, Contents), RecordingError> {
        let mut bag = Self { blocks: Blocks::open(path)?, topic_of_connection: HashMap::new(), chunks: None };
        let (summary, problems) = match bag.summary() {
            Ok(summary) => {
                bag.chunks = Some(summary.chunks.clone());
                (summary, Vec::new())
            }
            Err(_) => bag.scanned()?,
        };
        bag.topic_of_connection = summary.topic_of_connection;
        Ok((bag, Contents { topics: summary.topics, span: summary.span, problems }))
    }

    /// The record at `at`.
    fn record(&self, at: u64) -> Result<Record, RecordingError> {
        let damaged = self.damaged();
        let n_header = u64::from(Fields::packed(&self.blocks.read(at, 4)?).u32().map_err(&damaged)?);
        if n_header > MAX_HEADER_BYTES {
            return Err(self.blocks.damaged("the header of a record is too long"));
        }
        let bytes = self.blocks.read(at + 4, n_header + 4)?;
        let mut fields = Fields::packed(&bytes);
        let header = fields.take(n_header as usize).map_err(&damaged)?.to_vec();
        let n_bytes = u64::from(fields.u32().map_err(&damaged)?);
        Ok(Record { header, data: at + 4 + n_header + 4, n_bytes })
    }

    /// The data of a record, as much of it as is there.
    fn data(&self, record: &Record) -> Result<Vec<u8>, RecordingError> {
        if record.n_bytes > MAX_BLOCK_BYTES {
            return Err(self.blocks.damaged("a record is too long"));
        }
        self.blocks.read(record.data, record.n_bytes)
    }

    fn damaged(&self) -> impl Fn(MessageError) -> RecordingError + '_ {
        |error| self.blocks.damaged(format!("a record is none: {error}"))
    }

    /// What the end of the bag says, in order.
    fn summary(&self) -> Result<Summary, RecordingError> {
        let damaged = self.damaged();
        let first = self.record(BAG_MAGIC.len() as u64)?;
        let mut at = Header::read(&first.header)
            .and_then(|header| header.get("index_pos")?.u64())
            .map_err(&damaged)?;
        if at == 0 || at > self.blocks.n_bytes() {
            return Err(self.blocks.damaged("it has no index"));
        }
        let mut summary = Summary::default();
        while at < self.blocks.n_bytes() {
            let record = self.record(at)?;
            let data = self.data(&record)?;
            let header = Header::read(&record.header).map_err(&damaged)?;
            match header.op().map_err(&damaged)? {
                OP_CONNECTION => summary.connection(&header, &data),
                OP_CHUNK_INFO => summary.chunk(&header, &data),
                _ => Ok(()),
            }
            .map_err(&damaged)?;
            at = record.end();
        }
        Ok(summary)
    }

    /// The same of a bag without an end, and what could not be read of it.
    fn scanned(&self) -> Result<(Summary, Vec<String>), RecordingError> {
        let mut summary = Summary::default();
        let mut problems = self.scan(|header, data, _| {
            match header.op()? {
                OP_CONNECTION => summary.connection(header, data)?,
                OP_MESSAGE => {
                    let time_ns = header.get("time")?.time_ns()?;
                    summary.span = Some(Span::with(summary.span, Span::at(time_ns)));
                }
                _ => (),
            }
            Ok(())
        })?;
        problems.insert(0, NO_INDEX.to_owned());
        Ok((summary, problems))
    }

    /// Calls `on_record` with the header, the data and the place of each record in chunks. Returns what could not be read.
    fn scan(
        &self,
        mut on_record: impl FnMut(&Header, &[u8], Place) -> Result<(), MessageError>,
    ) -> Result<Vec<String>, RecordingError> {
        let (mut at, mut problems) = (BAG_MAGIC.len() as u64, Vec::new());
        while at < self.blocks.n_bytes() {
            let Ok(record) = self.record(at) else {
                problems.push(ENDS_EARLY.to_owned());
                break;
            };
            let header = Header::read(&record.header);
            if let Ok(header) = header.as_ref()
                && header.op() == Ok(OP_CHUNK)
            {
                match self.data(&record).and_then(|data| self.unpacked(header, &data)) {
                    Ok(Unpacked { bytes, cut }) => {
                        problems.extend(
                            cut.map(|reason| format!("a chunk is damaged, and read up to there: {reason}")),
                        );
                        for (within, header, data) in records(&bytes) {
                            let place = Place { at, within: Some(within) };
                            if on_record(&header, data, place).is_err() {
                                problems.push("a record is damaged: left out".to_owned());
                            }
                        }
                    }
                    Err(error) => problems.push(error.to_string()),
                }
            }
            at = record.end();
            if at > self.blocks.n_bytes() {
                problems.push(ENDS_EARLY.to_owned());
            }
        }
        Ok(problems)
    }

    /// What is in a chunk.
    fn unpacked(&self, header: &Header, data: &[u8]) -> Result<Unpacked, RecordingError> {
        let packing = header.text("compression").map_err(self.damaged())?;
        let known = Packing::of(&packing);
        let known = known.ok_or_else(|| {
            self.blocks.damaged(format!("a chunk is packed by {packing}, which is not read"))
        })?;
        Ok(Unpacked::from(data, known))
    }

    /// The messages of the topics that are wanted.
    pub(super) fn index(&self, wanted: &[bool]) -> Result<Index, RecordingError> {
        let mut index = Index::default();
        let wanted = |header: &Header| {
            let connection = header.get("conn")?.u32()?;
            Ok::<_, MessageError>(
                self.topic_of_connection.get(&connection).copied().filter(|&idx| wanted[idx]),
            )
        };
        let Some(chunks) = &self.chunks else {
            // What is wrong was told when the bag was opened.
            self.scan(|header, _, place| {
                if header.op()? == OP_MESSAGE
                    && let Some(topic_idx) = wanted(header)?
                {
                    index.entries.push(Entry { topic_idx, time_ns: header.get("time")?.time_ns()?, place });
                }
                Ok(())
            })?;
            return Ok(index);
        };
        for &chunk in chunks {
            if let Err(error) = self.add_of_chunk(chunk, &wanted, &mut index.entries) {
                index.problems.push(error.to_string());
            }
        }
        Ok(index)
    }

    /// Adds the messages that are wanted of a chunk, by the records of its index, which follow it.
    fn add_of_chunk(
        &self,
        chunk: u64,
        wanted: &impl Fn(&Header) -> Result<Option<usize>, MessageError>,
        entries: &mut Vec<Entry>,
    ) -> Result<(), RecordingError> {
        let damaged = self.damaged();
        let mut at = self.record(chunk)?.end();
        while at < self.blocks.n_bytes() {
            let record = self.record(at)?;
            let header = Header::read(&record.header).map_err(&damaged)?;
            if header.op() != Ok(OP_INDEX) {
                break;
            }
            if let Some(topic_idx) = wanted(&header).map_err(&damaged)? {
                let data = self.data(&record)?;
                let mut listed = Fields::packed(&data);
                while !listed.rest().is_empty() {
                    let time_ns = listed.time_ns().map_err(&damaged)?;
                    let place = Place { at: chunk, within: Some(listed.u32().map_err(&damaged)?) };
                    entries.push(Entry { topic_idx, time_ns, place });
                }
            }
            at = record.end();
        }
        Ok(())
    }

    /// A message.
    pub(super) fn message(&self, place: Place) -> Result<Vec<u8>, RecordingError> {
        let block = self.blocks.block(place.at, || {
            let record = self.record(place.at)?;
            let header = Header::read(&record.header).map_err(self.damaged())?;
            Ok(self.unpacked(&header, &self.data(&record)?)?.bytes)
        })?;
        let bytes = block.get(place.within.unwrap_or_default() as usize..).unwrap_or_default();
        let message = records(bytes).next().map(|(_, _, data)| data.to_vec());
        message.ok_or_else(|| self.blocks.damaged("a chunk ends before a message"))
    }
}

/// The records of a chunk that are whole: where each begins, its header and its data.
fn records(chunk: &[u8]) -> impl Iterator<Item = (u32, Header<'_>, &[u8])> {
    let mut fields = Fields::packed(chunk);
    std::iter::from_fn(move || {
        let within = u32::try_from(chunk.len() - fields.rest().len()).ok()?;
        let header = Header::read(fields.bytes().ok()?).ok()?;
        Some((within, header, fields.bytes().ok()?))
    })
}
