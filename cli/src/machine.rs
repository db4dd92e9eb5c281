//! What a measurement was made on and with: processor, memory, compiler, commit.

use std::fs;

/// The version with compiler and commit, as records of measurements name it.
pub(crate) const VERSION: &str =
    concat!(env!("CARGO_PKG_VERSION"), " ", env!("FREELUX_COMMIT"), ", ", env!("FREELUX_COMPILER"));

/// Returns the name of the processor, or its architecture where the system does not tell (all but Linux).
pub(crate) fn processor() -> String {
    let text = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name =
        text.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':').map(|(_, name)| name.trim()));
    name.unwrap_or(std::env::consts::ARCH).to_owned()
}

/// Returns the largest resident size so far in bytes, where the system tells it (Linux).
pub(crate) fn peak_bytes() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024)
}

/// Begins anew to look for the largest resident size; whether the system allows it (Linux).
pub(crate) fn forget_peak() -> bool {
    // 5: see proc_pid_clear_refs(5).
    fs::write("/proc/self/clear_refs", "5").is_ok()
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn the_peak_grows_with_what_is_used() {
        let before = peak_bytes().unwrap();
        let used = std::hint::black_box(vec![1_u8; 64 << 20]);
        let after = peak_bytes().unwrap();
        assert!(after >= used.len() as u64, "{before} grew to {after}");
    }

    #[test]
    fn version_names_compiler_and_processor_has_a_name() {
        assert!(VERSION.contains("rustc "), "{VERSION}");
        assert!(!processor().is_empty(), "a name");
    }
}
