//! A cable between a vehicle's port and a simulated module at a pseudo-terminal of a world, which can be pulled out and plugged
//! in; it notes when beacons went on the air.

use std::os::fd::OwnedFd;
use std::os::unix::fs::symlink;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use rustix::fs::{Mode, OFlags, fcntl_setfl};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
use tomoswarm::hw::xbee_frame::{ApiMode, Decoder, Frame};

const BAUD: u32 = 115_200;

pub struct Cable {
    module: PathBuf,
    port: PathBuf,
    /// When the module said that a beacon was sent, last.
    sent: Arc<Mutex<Option<Instant>>>,
    plugged: Option<(Arc<AtomicBool>, JoinHandle<()>)>,
}

impl Cable {
    /// From a module to a port that is there as long as it is plugged in.
    pub fn new(module: PathBuf, port: PathBuf) -> Cable {
        Cable {
            module,
            port,
            sent: Arc::default(),
            plugged: None,
        }
    }

    pub fn plug(&mut self) {
        let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
        let module = rustix::fs::open(&self.module, flags, Mode::empty()).unwrap();
        let mut settings = tcgetattr(&module).unwrap();
        settings.make_raw();
        settings.set_speed(BAUD).unwrap();
        tcsetattr(&module, OptionalActions::Now, &settings).unwrap();
        let host = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
        fcntl_setfl(&host, OFlags::NONBLOCK).unwrap();
        grantpt(&host).unwrap();
        unlockpt(&host).unwrap();
        let name = ptsname(&host, Vec::new()).unwrap();
        symlink(name.to_str().unwrap(), &self.port).unwrap();
        let is_out = Arc::new(AtomicBool::new(false));
        let (is_ended, sent) = (is_out.clone(), self.sent.clone());
        let carry = std::thread::spawn(move || carry(&host, &module, &is_ended, &sent));
        self.plugged = Some((is_out, carry));
    }

    pub fn pull_out(&mut self) {
        let (is_out, carry) = self.plugged.take().expect("it is plugged in");
        std::fs::remove_file(&self.port).unwrap();
        is_out.store(true, Ordering::Release);
        carry.join().unwrap();
    }

    /// Waits until a beacon has gone on the air since a moment; returns after how long.
    pub fn sent_after(&self, since: Instant) -> Duration {
        loop {
            let sent = self.sent.lock().unwrap().filter(|at| *at > since);
            if let Some(at) = sent {
                return at - since;
            }
            assert!(since.elapsed() < Duration::from_secs(20), "nothing is sent");
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

fn carry(host: &OwnedFd, module: &OwnedFd, is_out: &AtomicBool, sent: &Mutex<Option<Instant>>) {
    let (mut bytes, mut decoder) = ([0; 512], Decoder::new(ApiMode::Escaped));
    while !is_out.load(Ordering::Acquire) {
        // Nothing there, or nobody at the other end: what is lost is lost.
        let from_host = rustix::io::read(host, &mut bytes).unwrap_or(0);
        let _ = rustix::io::write(module, &bytes[..from_host]);
        let from_module = rustix::io::read(module, &mut bytes).unwrap_or(0);
        decoder.take(&bytes[..from_module], |frame| {
            if matches!(frame, Frame::TransmitStatus { status: 0, .. }) {
                *sent.lock().unwrap() = Some(Instant::now());
            }
        });
        let _ = rustix::io::write(host, &bytes[..from_module]);
        if from_host + from_module == 0 {
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}
