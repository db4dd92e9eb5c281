//! The peak memory of the process.

/// Returns the largest resident size so far in bytes, where the system tells it (Linux).
pub(crate) fn peak_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024)
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    #[test]
    fn the_peak_grows_with_what_is_used() {
        let before = super::peak_bytes().unwrap();
        let used = vec![1_u8; 64 << 20];
        let after = super::peak_bytes().unwrap();
        assert!(after >= used.len() as u64, "{before} grew to {after}");
    }
}
