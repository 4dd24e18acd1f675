//! Pictures one after the other, each behind a line with its length, as ffmpeg's `mpjpeg` writes them (and cameras do, as
//! `multipart/x-mixed-replace`).

use std::io;
use tokio::io::{AsyncBufRead, AsyncBufReadExt, AsyncRead, AsyncReadExt, BufReader};

/// The longest picture, in bytes.
const MAX_PICTURE_BYTES: usize = 64 << 20;

/// The longest line before a picture, in bytes.
const MAX_LINE_BYTES: u64 = 4096;

/// Reads pictures.
pub(super) struct Pictures<R> {
    reader: BufReader<R>,
}

impl<R: AsyncRead + Unpin> Pictures<R> {
    pub(super) fn new(reader: R) -> Self {
        Self { reader: BufReader::new(reader) }
    }

    /// The next picture; none at the end.
    ///
    /// # Errors
    /// What the system says, and what is no picture behind its length.
    pub(super) async fn next(&mut self) -> io::Result<Option<Vec<u8>>> {
        let mut length = None;
        while let Some(line) = line(&mut self.reader).await? {
            let line = String::from_utf8_lossy(&line);
            match (line.trim_end(), length) {
                ("", Some(length)) => {
                    let mut picture = Vec::new();
                    (&mut self.reader).take(length as u64).read_to_end(&mut picture).await?;
                    return Ok((picture.len() == length).then_some(picture));
                }
                (header, _) => {
                    if let Some((name, value)) = header.split_once(':')
                        && name.eq_ignore_ascii_case("content-length")
                    {
                        length = value
                            .trim()
                            .parse()
                            .ok()
                            .filter(|length| (1..=MAX_PICTURE_BYTES).contains(length));
                        length.ok_or_else(|| io::Error::other("a picture without a length"))?;
                    }
                }
            }
        }
        Ok(None)
    }
}

/// The next line; none at the end.
async fn line(reader: &mut (impl AsyncBufRead + Unpin)) -> io::Result<Option<Vec<u8>>> {
    let mut line = Vec::new();
    let n_bytes = reader.take(MAX_LINE_BYTES).read_until(b'\n', &mut line).await?;
    match n_bytes as u64 {
        0 => Ok(None),
        MAX_LINE_BYTES => Err(io::Error::other("no pictures behind their lengths")),
        _ => Ok(Some(line)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    async fn read(bytes: &[u8]) -> (Vec<Vec<u8>>, Option<String>) {
        let (mut pictures, mut read) = (Pictures::new(bytes), Vec::new());
        loop {
            match pictures.next().await {
                Ok(Some(picture)) => read.push(picture),
                Ok(None) => return (read, None),
                Err(error) => return (read, Some(error.to_string())),
            }
        }
    }

    #[tokio::test]
    async fn pictures_come_whole_or_not() {
        let two = b"--ffmpeg\r\nContent-type: image/jpeg\r\nContent-length: 3\r\n\r\na\nb\r\n--ffmpeg\r\ncontent-length: 2\r\n\r\ncd\r\n";
        assert_eq!(read(two).await, (vec![b"a\nb".to_vec(), b"cd".to_vec()], None));
        assert_eq!(read(&two[..two.len() - 4]).await, (vec![b"a\nb".to_vec()], None), "cut");
    }

    #[tokio::test]
    async fn no_length_is_believed() {
        let endless = vec![b'a'; 10_000];
        assert!(read(&endless).await.1.is_some());
        for length in ["-1", "0", "99999999999", "x"] {
            let bytes = format!("Content-length: {length}\r\n\r\nabc");
            let (pictures, error) = read(bytes.as_bytes()).await;
            assert!(pictures.is_empty() && error.is_some(), "{length}");
        }
    }
}
