//! Signals: the first requests a stop, the second exits at once.

use crate::cli::shared::output;
use terrane_base::error::ErrorKind;
use terrane_engine::Cancel;

/// Ctrl-C, SIGTERM and SIGHUP stop the job. Signals ignored at the start stay ignored, as required by nohup and
/// job control. Without a handler the system's default applies, which is not an error.
pub(super) fn stop(cancel: Cancel) {
    listen(move || {
        if cancel.check().is_err() {
            std::process::exit(ErrorKind::Interrupted.exit_code().into());
        }
        cancel.cancel();
        output::note("stopping; press Ctrl-C again to quit at once");
    });
}

#[cfg(unix)]
fn listen(on_signal: impl Fn() + Send + 'static) {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    let ignored = std::fs::read_to_string("/proc/self/status").ok();
    let ignored = ignored.as_deref().and_then(ignored_signals);
    // If ignored signals are unknown, SIGHUP is left to the system.
    let known: &[i32] =
        if ignored.is_some() { &[SIGINT, SIGTERM, SIGHUP] } else { &[SIGINT, SIGTERM] };
    let ignored = ignored.unwrap_or(0);
    let handled = known.iter().filter(|signal| ignored >> (**signal - 1) & 1 == 0);
    if let Ok(mut signals) = signal_hook::iterator::Signals::new(handled) {
        std::thread::spawn(move || signals.forever().for_each(|_| on_signal()));
    }
}

#[cfg(not(unix))]
fn listen(on_signal: impl Fn() + Send + 'static) {
    let _ = ctrlc::set_handler(on_signal);
}

/// Ignored signals (bit n is signal n + 1) from Linux's `/proc/self/status`.
#[cfg(unix)]
fn ignored_signals(status: &str) -> Option<u64> {
    let line = status.lines().find_map(|line| line.strip_prefix("SigIgn:"))?;
    u64::from_str_radix(line.trim(), 16).ok()
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn ignored_signals_are_read_from_the_status() {
        let status = "Name:\tterrane\nSigBlk:\t0000000000000000\nSigIgn:\t0000000000001001\n";
        assert_eq!(ignored_signals(status), Some(0x1001));
        assert_eq!(ignored_signals("SigIgn:\tnonsense\n"), None);
        assert_eq!(ignored_signals(""), None);
    }
}
