//! The samples that were heard, run by run, packed and compressed, for whoever saves them. Bounded: when there is no room the
//! samples of the oldest run go, and of a run that fills all of it those that come then are left out.

use std::collections::BTreeMap;
use std::sync::Arc;

use tomoswarm_proto::codec;
use tomoswarm_proto::{Boot, RunId, Sample, VehicleId};

use super::deflate::{deflate, inflate};
use crate::tomo::{SAMPLES_HEADER, SampleLine};

/// All samples together take at most so many bytes.
const SAMPLE_BYTES_MAX: usize = 8 << 20;
/// So many bytes of samples of a run are compressed together.
const BLOCK_BYTES: usize = 64 << 10;

/// The samples of all runs. A copy shares what is packed until more comes.
#[derive(Clone, Debug)]
pub struct SampleBook {
    runs: BTreeMap<RunId, Arc<RunSamples>>,
    bytes: usize,
    bytes_max: usize,
}

/// Those of one run: one after another, each with its length before it.
#[derive(Clone, Debug, Default)]
struct RunSamples {
    /// Full blocks, compressed.
    blocks: Vec<Arc<[u8]>>,
    block_bytes: usize,
    /// What has come since, as it is.
    open: Vec<u8>,
    kept: u64,
    left_out: u64,
}

impl Default for SampleBook {
    fn default() -> SampleBook {
        SampleBook::new(SAMPLE_BYTES_MAX)
    }
}

impl SampleBook {
    /// Makes an empty one of so many bytes at most.
    pub fn new(bytes_max: usize) -> SampleBook {
        SampleBook {
            runs: BTreeMap::new(),
            bytes: 0,
            bytes_max,
        }
    }

    /// Takes a sample that is new.
    pub fn take(&mut self, run: RunId, who: (VehicleId, Boot), sample: &Sample) {
        let packed = codec::pack(&(who, sample)).unwrap_or_default();
        let Ok(length) = u16::try_from(packed.len()) else {
            return;
        };
        while self.bytes + packed.len() + 2 > self.bytes_max {
            let is_alone = self.runs.keys().next() == Some(&run);
            let oldest = self.runs.first_entry().filter(|_| !is_alone);
            let Some(oldest) = oldest else {
                self.run_mut(run).left_out += 1;
                return;
            };
            self.bytes -= oldest.remove().bytes();
        }
        let of_run = self.run_mut(run);
        let before = of_run.bytes();
        of_run.open.extend(length.to_le_bytes());
        of_run.open.extend(&packed);
        of_run.kept += 1;
        of_run.close_block_when_full();
        let after = of_run.bytes();
        self.bytes = self.bytes - before + after;
    }

    fn run_mut(&mut self, run: RunId) -> &mut RunSamples {
        Arc::make_mut(self.runs.entry(run).or_default())
    }

    /// Returns how many samples of a run were left out.
    pub fn left_out(&self, run: RunId) -> u64 {
        self.runs.get(&run).map_or(0, |of_run| of_run.left_out)
    }

    /// Returns how many samples of a run have come, those that were left out included.
    pub fn heard(&self, run: RunId) -> u64 {
        self.kept(run) + self.left_out(run)
    }

    /// Returns how many samples of a run are kept.
    pub fn kept(&self, run: RunId) -> u64 {
        self.runs.get(&run).map_or(0, |of_run| of_run.kept)
    }

    /// Returns the samples of a run that are kept, in the order in which they came, each with the vehicle that made it.
    pub fn of(&self, run: RunId) -> impl Iterator<Item = (VehicleId, Boot, Sample)> {
        let of_run = self.runs.get(&run).into_iter();
        of_run.flat_map(|of_run| {
            let inflated = of_run.blocks.iter().map(|block| {
                let mut packed = Vec::new();
                inflate(block, &mut packed);
                packed
            });
            let open = std::iter::once_with(|| of_run.open.clone());
            inflated.chain(open).flat_map(|packed| unpacked(&packed))
        })
    }

    /// Returns the samples of a run as CSV, in the order in which they came; `None` = there are none.
    pub fn csv(&self, run: RunId) -> Option<String> {
        self.runs.get(&run)?;
        let mut text = format!("{SAMPLES_HEADER}\n");
        for (vehicle, boot, sample) in self.of(run) {
            let line = SampleLine {
                vehicle,
                boot,
                run,
                sample: &sample,
                utc_s: None,
            };
            line.write(&mut text);
        }
        Some(text)
    }

    /// Returns whether it has samples of a run.
    pub fn has(&self, run: RunId) -> bool {
        self.runs.contains_key(&run)
    }
}

impl RunSamples {
    /// Returns the bytes that they take.
    fn bytes(&self) -> usize {
        self.block_bytes + self.open.len()
    }

    /// Compresses what is open once it is a block.
    fn close_block_when_full(&mut self) {
        if self.open.len() >= BLOCK_BYTES {
            let block = deflate(&self.open);
            self.block_bytes += block.len();
            self.blocks.push(block.into());
            self.open.clear();
        }
    }
}

/// Returns samples that are one after another, each with its length before it.
fn unpacked(packed: &[u8]) -> Vec<(VehicleId, Boot, Sample)> {
    let (mut samples, mut rest) = (Vec::new(), packed);
    while let Some((length, after)) = rest.split_first_chunk()
        && let Some((packed, after)) = after.split_at_checked(u16::from_le_bytes(*length).into())
        && let Ok(((vehicle, boot), sample)) = codec::unpack(packed)
    {
        samples.push((vehicle, boot, sample));
        rest = after;
    }
    samples
}

#[cfg(test)]
mod tests {
    use super::*;
    use tomoswarm_proto::PoseReport;

    fn sample(sequence: u64) -> Sample {
        Sample {
            sequence,
            heard_at_ns: sequence * 1_000_000_000,
            transmitter: VehicleId(2),
            transmitter_pose: PoseReport::default(),
            receiver_pose: PoseReport::default(),
            channel: 11,
            power_dbm: 0,
            rssi_dbm: sequence.is_multiple_of(2).then_some(-60),
        }
    }

    const WHO: (VehicleId, Boot) = (VehicleId(1), Boot(7));

    #[test]
    fn samples_come_back_as_lines_in_the_order_in_which_they_came() {
        let mut book = SampleBook::default();
        for sequence in [4, 5] {
            book.take(RunId(3), WHO, &sample(sequence));
        }
        let text = book.csv(RunId(3)).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], SAMPLES_HEADER);
        assert!(lines[1].starts_with("1,7,3,4,4.000000,,,2,") && lines[1].ends_with(",-60"));
        assert!(lines[2].starts_with("1,7,3,5,5.000000,,,2,") && lines[2].ends_with(','));
        assert_eq!((lines.len(), book.csv(RunId(4))), (3, None));
        assert_eq!((book.kept(RunId(3)), book.kept(RunId(4))), (2, 0));
    }

    #[test]
    fn samples_of_many_blocks_come_back_as_they_came_and_a_copy_keeps_what_it_had() {
        let mut book = SampleBook::default();
        let of_run = |book: &SampleBook| -> Vec<u64> {
            book.of(RunId(3))
                .map(|(.., sample)| sample.sequence)
                .collect()
        };
        (0..9000).for_each(|sequence| book.take(RunId(3), WHO, &sample(sequence)));
        let copy = book.clone();
        (9000..10_000).for_each(|sequence| book.take(RunId(3), WHO, &sample(sequence)));
        let blocks = book.runs[&RunId(3)].blocks.len();
        assert!(blocks > 2 && book.bytes < blocks * BLOCK_BYTES, "{blocks}");
        assert_eq!(book.bytes, book.runs[&RunId(3)].bytes());
        assert_eq!(of_run(&book), (0..10_000).collect::<Vec<u64>>());
        assert_eq!(of_run(&copy), (0..9000).collect::<Vec<u64>>());
    }

    #[test]
    fn the_oldest_run_makes_room_and_a_run_that_fills_all_of_it_is_cut() {
        let mut book = SampleBook::new(2000);
        for sequence in 0..20 {
            book.take(RunId(1), WHO, &sample(sequence));
        }
        assert!(book.has(RunId(1)) && book.left_out(RunId(1)) == 0);
        for sequence in 0..500 {
            book.take(RunId(2), WHO, &sample(sequence));
        }
        assert!(!book.has(RunId(1)) && book.bytes <= 2000);
        let kept = book.kept(RunId(2));
        assert!(kept > 10, "{kept}");
        assert_eq!(book.of(RunId(2)).count() as u64, kept);
        assert_eq!(book.csv(RunId(2)).unwrap().lines().count() as u64, kept + 1);
        assert_eq!(kept + book.left_out(RunId(2)), 500);
    }
}
