//! MCAP (<https://mcap.dev/spec>): by its index, or record after record where there is none.

use super::blocks::{Blocks, MAX_BLOCK_BYTES, Packing, Unpacked};
use super::{Contents, ENDS_EARLY, Entry, Index, NO_INDEX, Place, Span, number_of};
use crate::error::RecordingError;
use crate::fields::Fields;
use crate::topic::{Encoding, Topic};
use mcap::records::{ChunkIndex, Record, op};
use mcap::sans_io::{SummaryReadEvent, SummaryReader, SummaryReaderOptions};
use mcap::{MAGIC, McapResult, Summary, parse_record};
use std::collections::HashMap;
use std::path::Path;

/// What a record begins with: what it is, and how long.
const HEAD_BYTES: u64 = 9;

/// A file.
#[derive(Debug)]
pub(crate) struct McapFile {
    blocks: Blocks,
    /// By the number that the file has for it.
    topic_of_channel: HashMap<u16, usize>,
    /// Where the chunks lie; none where the file does not say, and is read record after record.
    chunks: Option<Vec<ChunkIndex>>,
}

/// A record of a file or of a chunk.
struct RecordHead {
    op: u8,
    n_bytes: u64,
}

impl RecordHead {
    /// At the beginning of bytes.
    fn read(bytes: &[u8]) -> Option<Self> {
        let mut fields = Fields::packed(bytes);
        Some(Self { op: fields.u8().ok()?, n_bytes: fields.u64().ok()? })
    }
}

/// The topics of a file, as they are met.
#[derive(Default)]
struct Channels {
    topics: Vec<Topic>,
    topic_of_channel: HashMap<u16, usize>,
    types: HashMap<u16, String>,
}

impl Channels {
    fn add(&mut self, channel: u16, schema: u16, name: String, encoding: &str) {
        let type_name = self.types.get(&schema).cloned().unwrap_or_default();
        let topic = Topic { name, type_name, encoding: Encoding::of(encoding), n_messages: None };
        if !self.topic_of_channel.contains_key(&channel) {
            self.topic_of_channel.insert(channel, number_of(&mut self.topics, topic));
        }
    }

    /// What a record says of them, if anything.
    fn meet(&mut self, record: &Record) {
        match record {
            Record::Schema { header, .. } => {
                self.types.insert(header.id, header.name.clone());
            }
            Record::Channel(channel) => {
                self.add(channel.id, channel.schema_id, channel.topic.clone(), &channel.message_encoding);
            }
            _ => (),
        }
    }
}

impl McapFile {
    /// Opens a file and finds what is in it.
    pub(super) fn open(path: &Path) -> Result<(Self, Contents), RecordingError> {
        let mut file = Self { blocks: Blocks::open(path)?, topic_of_channel: HashMap::new(), chunks: None };
        let mut channels = Channels::default();
        let summary = file.summary().ok().flatten().filter(is_whole);
        let Some(summary) = summary else {
            let mut span = None;
            let mut problems = file.scan(|record, _| {
                channels.meet(record);
                if let Record::Message { header, .. } = record {
                    span = Some(Span::with(span, Span::at(header.log_time)));
                }
            })?;
            problems.insert(0, NO_INDEX.to_owned());
            file.topic_of_channel = channels.topic_of_channel;
            return Ok((file, Contents { topics: channels.topics, span, problems }));
        };
        let counts = summary.stats.as_ref().map(|stats| &stats.channel_message_counts);
        let mut of_file: Vec<_> = summary.channels.values().collect();
        of_file.sort_by_key(|channel| channel.id);
        for channel in of_file {
            let schema = channel.schema.as_ref();
            let schema_id = schema.map_or(0, |schema| schema.id);
            channels.types.insert(schema_id, schema.map(|schema| schema.name.clone()).unwrap_or_default());
            channels.add(channel.id, schema_id, channel.topic.clone(), &channel.message_encoding);
        }
        for (channel, topic_idx) in &channels.topic_of_channel {
            if let Some(counts) = counts {
                let n_messages = &mut channels.topics[*topic_idx].n_messages;
                *n_messages =
                    Some(n_messages.unwrap_or_default() + counts.get(channel).copied().unwrap_or_default());
            }
        }
        let of_chunk = |chunk: &ChunkIndex| {
            let span = Span { first_ns: chunk.message_start_time, last_ns: chunk.message_end_time };
            (!chunk.message_index_offsets.is_empty()).then_some(span)
        };
        let spans = summary.chunk_indexes.iter().filter_map(of_chunk);
        let span = spans.fold(None, |span, other| Some(Span::with(span, other)));
        file.topic_of_channel = channels.topic_of_channel;
        file.chunks = Some(summary.chunk_indexes);
        Ok((file, Contents { topics: channels.topics, span, problems: Vec::new() }))
    }

    /// What the end of the file tells of it.
    fn summary(&self) -> McapResult<Option<Summary>> {
        let n_bytes = self.blocks.n_bytes();
        let options = SummaryReaderOptions::default()
            .with_file_size(n_bytes)
            .with_record_length_limit(n_bytes.min(MAX_BLOCK_BYTES) as usize);
        let mut reader = SummaryReader::new_with_options(options);
        let mut at = 0;
        while let Some(event) = reader.next_event() {
            match event? {
                SummaryReadEvent::ReadRequest(n_bytes) => {
                    let bytes = self.blocks.read(at, n_bytes as u64).map_err(std::io::Error::other)?;
                    reader.insert(bytes.len())[..bytes.len()].copy_from_slice(&bytes);
                    reader.notify_read(bytes.len());
                    at += bytes.len() as u64;
                }
                SummaryReadEvent::SeekRequest(to) => {
                    at = match to {
                        std::io::SeekFrom::Start(at) => at,
                        std::io::SeekFrom::End(back) => n_bytes.saturating_add_signed(back),
                        std::io::SeekFrom::Current(on) => at.saturating_add_signed(on),
                    };
                    reader.notify_seeked(at);
                }
            }
        }
        Ok(reader.finish())
    }

    /// Calls `on_record` with each schema, channel and message of the file and where it lies. Returns what could not be read.
    fn scan(&self, mut on_record: impl FnMut(&Record, Place)) -> Result<Vec<String>, RecordingError> {
        let (mut at, mut problems) = (MAGIC.len() as u64, Vec::new());
        while at < self.blocks.n_bytes() {
            let Some(RecordHead { op, n_bytes }) = RecordHead::read(&self.blocks.read(at, HEAD_BYTES)?)
            else {
                problems.push(ENDS_EARLY.to_owned());
                break;
            };
            let body = at + HEAD_BYTES;
            let is_cut = n_bytes > self.blocks.n_bytes() - body.min(self.blocks.n_bytes());
            match op {
                op::FOOTER | op::DATA_END => break,
                op::CHUNK if n_bytes <= MAX_BLOCK_BYTES => {
                    let body = self.blocks.read(body, n_bytes)?;
                    problems.extend(scan_chunk(at, &body, &mut on_record));
                }
                op::SCHEMA | op::CHANNEL | op::MESSAGE if !is_cut && n_bytes <= MAX_BLOCK_BYTES => {
                    let bytes = self.blocks.read(body, n_bytes)?;
                    match parse_record(op, &bytes) {
                        Ok(record) => on_record(&record, Place { at, within: None }),
                        Err(error) => problems.push(format!("a record is damaged: {error}")),
                    }
                }
                _ => (),
            }
            if is_cut {
                problems.push(ENDS_EARLY.to_owned());
                break;
            }
            at = body + n_bytes;
        }
        Ok(problems)
    }

    /// The messages of the topics that are wanted.
    pub(super) fn index(&self, wanted: &[bool]) -> Result<Index, RecordingError> {
        let mut index = Index::default();
        let wanted = |channel: &u16| self.topic_of_channel.get(channel).copied().filter(|&idx| wanted[idx]);
        let Some(chunks) = &self.chunks else {
            // What is wrong was told when the file was opened.
            self.scan(|record, place| {
                if let Record::Message { header, .. } = record
                    && let Some(topic_idx) = wanted(&header.channel_id)
                {
                    index.entries.push(Entry { topic_idx, time_ns: header.log_time, place });
                }
            })?;
            return Ok(index);
        };
        for chunk in chunks {
            for (channel, &at) in &chunk.message_index_offsets {
                let Some(topic_idx) = wanted(channel) else { continue };
                match self.of_chunk(*channel, at) {
                    Ok(entries) => index.entries.extend(entries.into_iter().map(|(time_ns, within)| Entry {
                        topic_idx,
                        time_ns,
                        place: Place { at: chunk.chunk_start_offset, within: Some(within) },
                    })),
                    Err(error) => index.problems.push(error.to_string()),
                }
            }
        }
        Ok(index)
    }

    /// Times and places of the messages of a channel in a chunk, of the record at `at`.
    fn of_chunk(&self, channel: u16, at: u64) -> Result<Vec<(u64, u32)>, RecordingError> {
        let damaged = || self.blocks.damaged("the index of a chunk is none");
        let head = RecordHead::read(&self.blocks.read(at, HEAD_BYTES)?).ok_or_else(damaged)?;
        if head.op != op::MESSAGE_INDEX || head.n_bytes > MAX_BLOCK_BYTES {
            return Err(damaged());
        }
        let body = self.blocks.read(at + HEAD_BYTES, head.n_bytes)?;
        match parse_record(head.op, &body) {
            Ok(Record::MessageIndex(index)) if index.channel_id == channel => {
                let entry = |entry: mcap::records::MessageIndexEntry| {
                    Some((entry.log_time, u32::try_from(entry.offset).ok()?))
                };
                index.records.into_iter().map(entry).collect::<Option<_>>().ok_or_else(damaged)
            }
            _ => Err(damaged()),
        }
    }

    /// A message.
    pub(super) fn message(&self, place: Place) -> Result<Vec<u8>, RecordingError> {
        let damaged = |reason: &str| self.blocks.damaged(reason);
        let record = |bytes: &[u8]| {
            let RecordHead { op: op::MESSAGE, n_bytes } = RecordHead::read(bytes)? else { return None };
            let body = bytes.get(HEAD_BYTES as usize..)?.get(..usize::try_from(n_bytes).ok()?)?;
            match parse_record(op::MESSAGE, body) {
                Ok(Record::Message { data, .. }) => Some(data.into_owned()),
                _ => None,
            }
        };
        let head = RecordHead::read(&self.blocks.read(place.at, HEAD_BYTES)?);
        let head = head.filter(|head| head.n_bytes <= MAX_BLOCK_BYTES);
        let head = head.ok_or_else(|| damaged("a record is none"))?;
        let Some(within) = place.within else {
            let bytes = self.blocks.read(place.at, HEAD_BYTES + head.n_bytes)?;
            return record(&bytes).ok_or_else(|| damaged("a message is none"));
        };
        let block = self.blocks.block(place.at, || {
            let body = self.blocks.read(place.at + HEAD_BYTES, head.n_bytes)?;
            Ok(unpacked(&body).map_err(|reason| self.blocks.damaged(reason))?.bytes)
        })?;
        let bytes = block.get(within as usize..).unwrap_or_default();
        record(bytes).ok_or_else(|| damaged("a chunk ends before a message"))
    }
}

/// Calls `on_record` with the records of a chunk, whose record at `at` has this body, which may end early. Returns what is wrong with it.
fn scan_chunk(at: u64, body: &[u8], on_record: &mut impl FnMut(&Record, Place)) -> Option<String> {
    let Unpacked { bytes, cut } = match unpacked(body) {
        Ok(unpacked) => unpacked,
        Err(reason) => return Some(reason),
    };
    let mut within = 0;
    while let Some(RecordHead { op, n_bytes }) = RecordHead::read(&bytes[within..]) {
        let rest = &bytes[within + HEAD_BYTES as usize..];
        let body = rest.get(..usize::try_from(n_bytes).unwrap_or(usize::MAX));
        let (Some(body), Ok(offset)) = (body, u32::try_from(within)) else { break };
        if let op::SCHEMA | op::CHANNEL | op::MESSAGE = op
            && let Ok(record) = parse_record(op, body)
        {
            on_record(&record, Place { at, within: Some(offset) });
        }
        within += HEAD_BYTES as usize + body.len();
    }
    cut.map(|reason| format!("a chunk is damaged, and read up to there: {reason}"))
}

/// Whether a summary tells where all messages lie.
fn is_whole(summary: &Summary) -> bool {
    let n_messages = summary.stats.as_ref().map_or(u64::MAX, |stats| stats.message_count);
    let has_index =
        |chunk: &ChunkIndex| !chunk.message_index_offsets.is_empty() || chunk.uncompressed_size == 0;
    n_messages == 0 || (!summary.chunk_indexes.is_empty() && summary.chunk_indexes.iter().all(has_index))
}

/// What is in the body of a chunk's record, which may end early.
fn unpacked(body: &[u8]) -> Result<Unpacked, String> {
    let mut fields = Fields::packed(body);
    let mut head = || {
        let (_first, _last, n_bytes) = (fields.u64()?, fields.u64()?, fields.u64()?);
        let (checksum, packing, n_packed) = (fields.u32()?, fields.text()?, fields.u64()?);
        Ok::<_, crate::error::MessageError>((n_bytes, checksum, packing, n_packed))
    };
    let (n_bytes, checksum, packing, n_packed) = head().map_err(|error| error.to_string())?;
    let packing =
        Packing::of(&packing).ok_or_else(|| format!("a chunk is packed by {packing}, which is not read"))?;
    let packed = fields.rest();
    let packed = &packed[..packed.len().min(usize::try_from(n_packed).unwrap_or(usize::MAX))];
    let mut unpacked = Unpacked::from(packed, packing);
    if unpacked.cut.is_none() && unpacked.bytes.len() as u64 != n_bytes {
        unpacked.cut = Some("it has another length than it says".to_owned());
    }
    if unpacked.cut.is_none() && checksum != 0 && crc32fast::hash(&unpacked.bytes) != checksum {
        return Err("a chunk has another checksum than it says: left out".to_owned());
    }
    Ok(unpacked)
}
