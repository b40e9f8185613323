//! To how many nodes there are links. The library keeps its list of them behind a lock that it also holds while it writes to
//! the network, so that its answer may take as long as a neighbour lets it wait: it is asked on a thread of its own, and who
//! wants to know waits only a moment for it.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, SyncSender, channel, sync_channel};
use std::time::Duration;

/// The library is asked at least this often.
const LOOKS_EVERY: Duration = Duration::from_secs(1);
/// Who asks waits at most this long for the answer, and then takes the one before.
const ANSWERS_WITHIN: Duration = Duration::from_millis(20);

/// Counts links; cheap to clone. It counts on until the last one is dropped.
#[derive(Clone, Debug)]
pub(super) struct LinkCounter {
    questions: Sender<SyncSender<usize>>,
    last: Arc<AtomicUsize>,
}

impl LinkCounter {
    /// Begins to count by calling `look`, every second and when asked, until that gives `None`.
    ///
    /// # Errors
    /// The machine has no thread to give.
    pub(super) fn watch(
        mut look: impl FnMut() -> Option<usize> + Send + 'static,
    ) -> std::io::Result<LinkCounter> {
        let (questions, asked) = channel::<SyncSender<usize>>();
        let links = LinkCounter {
            questions,
            last: Arc::default(),
        };
        let last = links.last.clone();
        let watch = move || {
            loop {
                let question = match asked.recv_timeout(LOOKS_EVERY) {
                    Ok(question) => Some(question),
                    Err(RecvTimeoutError::Timeout) => None,
                    Err(RecvTimeoutError::Disconnected) => return,
                };
                // Whoever asks from now on is answered by the next look.
                let questions: Vec<SyncSender<usize>> =
                    question.into_iter().chain(asked.try_iter()).collect();
                let Some(count) = look() else { return };
                last.store(count, Ordering::Relaxed);
                // Some have gone on meanwhile.
                questions
                    .iter()
                    .for_each(|answer| answer.try_send(count).unwrap_or_default());
            }
        };
        std::thread::Builder::new()
            .name("bus-links".to_owned())
            .spawn(watch)?;
        Ok(links)
    }

    /// Returns how many there are, or were when that could be told last.
    pub(super) fn count(&self) -> usize {
        let (answer, answered) = sync_channel(1);
        // Nobody answers once the bus is closed.
        self.questions.send(answer).unwrap_or_default();
        answered
            .recv_timeout(ANSWERS_WITHIN)
            .unwrap_or_else(|_| self.last.load(Ordering::Relaxed))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;
    use std::time::Instant;

    use super::*;

    /// Counts one more at each look, which takes until it is let go.
    fn counting() -> (LinkCounter, Arc<AtomicBool>) {
        let holds = Arc::new(AtomicBool::new(false));
        let (held, mut count) = (holds.clone(), 0);
        let look = move || {
            while held.load(Ordering::Relaxed) {
                std::thread::sleep(Duration::from_millis(1));
            }
            count += 1;
            Some(count)
        };
        (LinkCounter::watch(look).unwrap(), holds)
    }

    #[test]
    fn who_asks_gets_a_new_answer() {
        let (links, _) = counting();
        // On a busy machine an answer may be late.
        assert!((0..100).any(|_| links.count() > 0));
        let first = links.count();
        assert!((0..100).any(|_| links.clone().count() > first));
    }

    #[test]
    fn nobody_waits_for_an_answer_that_does_not_come() {
        let (links, holds) = counting();
        let first = links.count();
        holds.store(true, Ordering::Relaxed);
        let began = Instant::now();
        let second = links.count();
        assert_eq!(links.count(), second);
        assert!(
            second <= first + 1 && began.elapsed() < Duration::from_millis(500),
            "{first} {second}"
        );
        holds.store(false, Ordering::Relaxed);
        let is_counting = (0..100).any(|_| links.count() > second);
        assert!(is_counting);
    }

    #[test]
    fn when_nothing_can_be_counted_any_more_the_last_answer_stays() {
        let mut left = 2;
        let look = move || {
            left -= 1;
            (left > 0).then_some(7)
        };
        let links = LinkCounter::watch(look).unwrap();
        assert!((0..100).any(|_| links.count() == 7));
        assert_eq!([links.count(), links.count()], [7, 7]);
    }
}
