//! What Linux tells of this process; elsewhere nothing is known.

use std::fs;

/// How often a second Linux counts processor time in `/proc`, on every processor.
const TICKS_PER_SECOND: f64 = 100.0;

/// Bytes of memory in use.
pub fn resident_bytes() -> Option<f64> {
    resident(&fs::read_to_string("/proc/self/status").ok()?)
}

/// Processor time used so far, in seconds.
pub fn cpu_seconds() -> Option<f64> {
    cpu(&fs::read_to_string("/proc/self/stat").ok()?)
}

fn resident(status: &str) -> Option<f64> {
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    let kibibytes: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes * 1024.0)
}

/// See proc_pid_stat(5): user and system time are the 14th and 15th field. The second one, the program's
/// name, may itself have spaces and parentheses.
fn cpu(stat: &str) -> Option<f64> {
    let (_, after_name) = stat.rsplit_once(')')?;
    let mut times = after_name.split_whitespace().skip(11).map(str::parse::<f64>);
    let (user, system) = (times.next()?.ok()?, times.next()?.ok()?);
    Some((user + system) / TICKS_PER_SECOND)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_and_time_are_read() {
        assert_eq!(resident("Name:\tx\nVmRSS:\t    2048 kB\nThreads:\t4\n"), Some(2_097_152.0));
        let stat = "7 (a) (b c) S 1 7 7 0 -1 4194560 5 0 0 0 250 50 9 9 20 0 4 0 100 1 1";
        assert_eq!(cpu(stat), Some(3.0));
    }

    #[test]
    fn what_looks_otherwise_tells_nothing() {
        for text in ["", "VmRSS:", "VmRSS: many kB", "7 (a) S 1", "7 a S"] {
            assert_eq!((resident(text), cpu(text)), (None, None), "{text}");
        }
    }
}
