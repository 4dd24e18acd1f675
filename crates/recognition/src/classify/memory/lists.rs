//! The inverted index: what is remembered, under its words.

use super::words::Words;
use roomsight_vision::simd::{ByteColumns, ByteRows, Nearest};
use std::ops::Range;

/// Remembered descriptors one after the other.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Rows {
    pub(super) codes: Vec<i8>,
    /// The word of each.
    pub(super) words: Vec<u32>,
    /// The frame of each.
    pub(super) frame_idxs: Vec<u32>,
}

impl Rows {
    /// Keeps the rows of frames that have a new index, under that.
    pub(super) fn renumbered(&self, width: usize, new_frame_idxs: &[Option<u32>]) -> Self {
        let mut kept = Self::default();
        let rows = self.codes.chunks_exact(width).zip(&self.words).zip(&self.frame_idxs);
        for ((code, &word), &frame_idx) in rows {
            if let Some(new) = new_frame_idxs[frame_idx as usize] {
                kept.codes.extend_from_slice(code);
                kept.words.push(word);
                kept.frame_idxs.push(new);
            }
        }
        kept
    }

    /// Appends rows of one frame.
    pub(super) fn extend(&mut self, codes: &[i8], words: &[u32], frame_idx: u32) {
        self.codes.extend_from_slice(codes);
        self.words.extend_from_slice(words);
        self.frame_idxs.resize(self.words.len(), frame_idx);
    }
}

/// Rows by word, laid out for the search. A row's place among all is its column; the columns past a list's end up to
/// the next block are padding.
#[derive(Clone, Debug)]
pub(super) struct Lists {
    columns: ByteColumns,
    /// Of each column.
    frame_idxs: Vec<u32>,
    /// The first block of each list, and the end of the last.
    first_blocks: Vec<usize>,
    /// Rows of each list.
    lengths: Vec<usize>,
    width: usize,
}

impl Lists {
    /// `n_lists` lists of these rows, whose words are below that and whose codes have this width. In a list rows
    /// stay in their order.
    pub(super) fn new(rows: &Rows, n_lists: usize, width: usize) -> Self {
        let mut lengths = vec![0; n_lists];
        rows.words.iter().for_each(|&word| lengths[word as usize] += 1);
        let mut first_blocks = vec![0];
        let mut n_blocks = 0;
        for length in &lengths {
            n_blocks += usize::div_ceil(*length, ByteColumns::BLOCK);
            first_blocks.push(n_blocks);
        }
        let mut columns = ByteColumns::padding(n_blocks, width);
        let mut frame_idxs = vec![0; n_blocks * ByteColumns::BLOCK];
        let mut next: Vec<usize> = first_blocks.iter().map(|block| block * ByteColumns::BLOCK).collect();
        let all = rows.codes.chunks_exact(width).zip(&rows.words).zip(&rows.frame_idxs);
        for ((code, &word), &frame_idx) in all {
            let column_idx = next[word as usize];
            columns.set(column_idx, code);
            frame_idxs[column_idx] = frame_idx;
            next[word as usize] += 1;
        }
        Self { columns, frame_idxs, first_blocks, lengths, width }
    }

    /// The rows, list after list.
    pub(super) fn rows(&self) -> Rows {
        let n_rows = self.n_rows();
        let mut rows = Rows { codes: vec![0; n_rows * self.width], ..Rows::default() };
        let mut codes = rows.codes.chunks_exact_mut(self.width);
        for (word, (&length, &first_block)) in self.lengths.iter().zip(&self.first_blocks).enumerate() {
            let first = first_block * ByteColumns::BLOCK;
            for (column_idx, code) in (first..first + length).zip(&mut codes) {
                self.columns.get(column_idx, code);
            }
            rows.frame_idxs.extend_from_slice(&self.frame_idxs[first..first + length]);
            rows.words.resize(rows.frame_idxs.len(), word as u32);
        }
        rows
    }

    pub(super) fn n_rows(&self) -> usize {
        self.lengths.iter().sum()
    }

    /// Rows of each list.
    pub(super) fn lengths(&self) -> &[usize] {
        &self.lengths
    }

    /// The frame of the descriptor in a column.
    pub(super) fn frame_idx(&self, column_idx: u32) -> usize {
        self.frame_idxs[column_idx as usize] as usize
    }

    /// The frames that have a row in a list, once a row.
    pub(super) fn frames_of(&self, list_idx: usize) -> &[u32] {
        &self.frame_idxs[self.first_blocks[list_idx] * ByteColumns::BLOCK..][..self.lengths[list_idx]]
    }

    fn blocks(&self, list_idx: usize) -> Range<usize> {
        self.first_blocks[list_idx]..self.first_blocks[list_idx + 1]
    }

    /// The nearest `n_kept` columns of each row, looked for in all lists.
    pub(super) fn search_all(&self, rows: &ByteRows, n_kept: usize) -> Nearest {
        let row_idxs: Vec<u32> = (0..rows.n_rows() as u32).collect();
        let mut nearest = Nearest::new(rows.n_rows(), n_kept);
        nearest.look(rows, &row_idxs, &self.columns, 0..self.columns.n_blocks());
        nearest
    }

    /// The nearest `n_kept` columns of each row, looked for in the lists of the `n_visited` nearest words.
    pub(super) fn search(&self, words: &Words, rows: &ByteRows, n_visited: usize, n_kept: usize) -> Nearest {
        if n_visited >= self.lengths.len() {
            return self.search_all(rows, n_kept);
        }
        // A list is read once for all rows that visit it. Each row's nearest list comes first: after it only few
        // columns are near enough to be looked at twice.
        let visited = words.nearest(rows, n_visited);
        let mut nearest = Nearest::new(rows.n_rows(), n_kept);
        for ranks in [0..1, 1..n_visited] {
            let mut visits: Vec<(u32, u32)> = (0..rows.n_rows())
                .flat_map(|row_idx| {
                    let lists = visited.of(row_idx).skip(ranks.start).take(ranks.len());
                    lists.map(move |(_, list_idx)| (list_idx, row_idx as u32))
                })
                .collect();
            visits.sort_unstable();
            let mut row_idxs = Vec::new();
            for of_list in visits.chunk_by(|a, b| a.0 == b.0) {
                row_idxs.clear();
                row_idxs.extend(of_list.iter().map(|&(_, row_idx)| row_idx));
                nearest.look(rows, &row_idxs, &self.columns, self.blocks(of_list[0].0 as usize));
            }
        }
        nearest
    }
}
