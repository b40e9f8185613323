//! From recordings to the links of a volume: links between the very same places by what they had there in the empty sweep,
//! samples of copters pooled in bins with a height and compared as those of a plane are.
//!
//! Nothing is written here; the plane's work is done by `tomo::calibrate_in_space`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::error::CliError;
use super::image::{ImageCommand, bounds, read_files};
use super::image_checks::warning_of_itself;
use super::recording::Recording;
use super::standard_output::complain;
use crate::config::SourceFile;
use crate::geom::Rect;
use crate::tomo::{
    DeviceOffsets, DropReason, DroppedLinks, ImagingSettings, Link, MOST_VOLUME_LINKS, NoiseModel,
    PathLoss, SpaceBins, SpaceLink, VolumeLink, calibrate_in_space, floor_dbm,
};

/// Standard deviation of a packet, and of a link between two sweeps that stood at the very same places, dB.
const PACKET_SD_DB: f64 = 2.5;
const LINK_SD_DB: f64 = 1.1;
/// Where there are too many links, bins are so many times as wide, again and again, and at most so many times in all.
const WIDER: f64 = 1.25;
const WIDEST: f64 = 4.0;

/// A sweep with heights, and the empty one that it is compared with.
pub(super) struct Sweeps {
    now: Recording,
    empty: Option<Recording>,
}

/// What a volume is made of.
pub(super) struct VolumeInput {
    /// What the links have lost.
    pub(super) links: Vec<VolumeLink>,
    /// What was left out, and under which length a link is too short, metres.
    pub(super) dropped: DroppedLinks,
    pub(super) shortest_m: f64,
    /// Without an empty sweep the strength in free space.
    pub(super) law: Option<PathLoss>,
    /// So many links the empty sweep has.
    pub(super) empty: Option<usize>,
    /// By how much radios differ, where that was found.
    pub(super) offsets: Option<DeviceOffsets>,
    /// So many samples were read, each once, and so many left out as they had been given already; `None` of links.
    pub(super) samples: Option<(usize, usize)>,
    /// What the links enclose, or the recording names.
    pub(super) area: Rect,
    /// The ends of the links from above.
    pub(super) ring: Rect,
    /// The lowest and the highest end, metres.
    pub(super) heights_m: (f64, f64),
    /// The side of the bins in which the links were pooled, and whether it is wider than usual; `None` = in none.
    pub(super) bin_m: Option<f64>,
    pub(super) is_widened: bool,
}

impl Sweeps {
    /// Reads the recordings of a command, which must have heights.
    ///
    /// # Errors
    /// A file that cannot be read, that does not say how high its ends are, or an empty sweep of another place or channel.
    pub(super) fn read(
        command: &ImageCommand,
        made_from: &mut Vec<SourceFile>,
    ) -> Result<Sweeps, CliError> {
        let now = read_files(&command.files, None, made_from, &check_heights)?;
        let of_now = made_from.len();
        let empty = match command.empty.is_empty() {
            true => None,
            false => {
                let empty = read_files(&command.empty, Some(now.unit), made_from, &check_heights)?;
                command.check_alike(&now, &empty)?;
                Some(empty)
            }
        };
        let (of_now, of_empty) = made_from.split_at(of_now);
        if let Some(warning) = warning_of_itself(of_now, of_empty) {
            complain(&warning);
        }
        Ok(Sweeps { now, empty })
    }

    /// Returns what the links have lost: of links that have the very same places in an empty sweep there, of all others as in
    /// an image of a plane.
    pub(super) fn calibrated(&self, command: &ImageCommand) -> VolumeInput {
        let are_links = |one: &Recording| !one.is_of_samples;
        match &self.empty {
            Some(empty) if are_links(&self.now) && are_links(empty) => self.between_places(empty),
            Some(_) | None => self.driven(command),
        }
    }

    fn between_places(&self, empty: &Recording) -> VolumeInput {
        let (links, dropped, empty) = between_same_places(&self.now, empty);
        let ring = bounds(self.now.links.iter());
        VolumeInput {
            links,
            dropped,
            shortest_m: 0.0,
            law: None,
            empty: Some(empty),
            offsets: None,
            samples: None,
            area: self.now.area.unwrap_or(ring),
            ring,
            heights_m: range_of(self.now.heights_m.iter().map(|(from, to)| [*from, *to])),
            bin_m: None,
            is_widened: false,
        }
    }

    /// Widens bins while there are more links than a volume takes: whoever flies in wind visits many bins, and hears little in
    /// each.
    fn driven(&self, command: &ImageCommand) -> VolumeInput {
        let all = self.both().flat_map(|one| &one.links);
        let mut settings = command.settings(all, &self.now);
        let widest_m = WIDEST * settings.pairing_m;
        let mut input = self.in_bins(&settings);
        while input.links.len() > MOST_VOLUME_LINKS && settings.pairing_m < widest_m {
            settings.pairing_m *= WIDER;
            input = VolumeInput {
                is_widened: true,
                ..self.in_bins(&settings)
            };
        }
        input
    }

    fn in_bins(&self, settings: &ImagingSettings) -> VolumeInput {
        let bins = |recording: &Recording| bins_of(recording, settings.pairing_m);
        let empty = self.empty.as_ref().map(bins);
        let (now, empty, offsets) = bins(&self.now).links_against(empty.as_ref());
        let calibrated = calibrate_in_space(&now, empty.as_deref(), settings);
        let repeated = self.both().map(|recording| recording.repeated).sum();
        let samples = (self.now.links.len(), repeated);
        let ring = bounds(now.iter().map(|one| &one.link));
        VolumeInput {
            links: calibrated.links,
            dropped: calibrated.dropped,
            shortest_m: settings.shortest_link_m,
            law: calibrated.path_loss,
            empty: empty.map(|links| links.len()),
            offsets,
            samples: self.now.is_of_samples.then_some(samples),
            area: self.now.area.unwrap_or(ring),
            ring,
            heights_m: range_of(now.iter().map(|one| one.heights_m)),
            bin_m: Some(settings.pairing_m),
            is_widened: false,
        }
    }

    fn both(&self) -> impl Iterator<Item = &Recording> {
        [Some(&self.now), self.empty.as_ref()].into_iter().flatten()
    }
}

/// Checks that a recording says how high all ends are.
fn check_heights(path: &Path, recording: &Recording) -> Result<(), CliError> {
    if recording.heights_m.len() == recording.links.len() {
        return Ok(());
    }
    let reason = match (recording.is_of_samples, recording.without_heights) {
        (true, Some(line)) => format!(
            "found a sample without altitudes in line {line}, expected numbers in the columns tx_z_m and rx_z_m of every \
             sample for --layers"
        ),
        (true, None) | (false, _) => {
            let more = match path.file_name().is_some_and(|name| name == "links.csv") {
                true => "; the samples of a run have them (samples.csv)",
                false => "",
            };
            format!(
                "found links without heights, expected the columns tx_z_m and rx_z_m for --layers{more}"
            )
        }
    };
    Err(CliError::Input {
        path: PathBuf::from(path),
        reason,
    })
}

/// Returns the lowest and the highest of some heights.
fn range_of(heights_m: impl Iterator<Item = [f64; 2]>) -> (f64, f64) {
    let nothing = (f64::INFINITY, f64::NEG_INFINITY);
    heights_m.flatten().fold(nothing, |(low_m, high_m), at_m| {
        (low_m.min(at_m), high_m.max(at_m))
    })
}

/// Returns what a recording has heard and missed, in bins.
fn bins_of(recording: &Recording, bin_m: f64) -> SpaceBins {
    let mut bins = SpaceBins::new(bin_m);
    let heights = recording.heights_m.iter();
    for (index, (link, (from_m, to_m))) in recording.links.iter().zip(heights).enumerate() {
        let devices = recording.devices.get(index).copied().flatten();
        let heights_m = [*from_m, *to_m];
        bins.record(
            devices,
            &SpaceLink {
                link: *link,
                heights_m,
            },
        );
    }
    bins
}

type Key = [[i64; 3]; 2];

/// Returns both ends of the links of a recording, with which millimetres they stand at, whichever comes first.
fn ends(recording: &Recording) -> impl Iterator<Item = ([[f64; 3]; 2], Key)> + '_ {
    let of_link = move |(index, (from_z_m, to_z_m)): (usize, &(f64, f64))| {
        let link = &recording.links[index];
        let ends = [
            [link.from.x_m, link.from.y_m, *from_z_m],
            [link.to.x_m, link.to.y_m, *to_z_m],
        ];
        let mut key = ends.map(|end| end.map(|metres| libm::round(metres * 1e3) as i64));
        key.sort_unstable();
        (ends, key)
    };
    recording.heights_m.iter().enumerate().map(of_link)
}

/// What was measured between two places.
struct Pooled {
    ends: [[f64; 3]; 2],
    key: Key,
    /// Of all that was heard and missed there; its ends are those of the first.
    link: Link,
}

/// Returns what was measured between places, in the order in which they come first, and which of it is whose; what comes again
/// is pooled by its packets.
fn pooled(recording: &Recording) -> (Vec<Pooled>, BTreeMap<Key, usize>) {
    let (mut all, mut indices): (Vec<Pooled>, BTreeMap<Key, usize>) = (Vec::new(), BTreeMap::new());
    for (link, (ends, key)) in recording.links.iter().zip(ends(recording)) {
        let index = *indices.entry(key).or_insert(all.len());
        match all.get_mut(index) {
            Some(known) => {
                let Link { from, to, .. } = known.link;
                known.link = known.link.pooled(&Link { from, to, ..*link });
            }
            None => all.push(Pooled {
                ends,
                key,
                link: *link,
            }),
        }
    }
    (all, indices)
}

/// Returns what the links have lost that were measured in both sweeps between the same places, how many were not, and how many
/// places the empty sweep has links between.
fn between_same_places(
    now: &Recording,
    empty: &Recording,
) -> (Vec<VolumeLink>, DroppedLinks, usize) {
    let recorded = now.imaging.as_ref();
    let usual_dbm = NoiseModel::default().sensitivity_dbm;
    let sensitivity_dbm = recorded.map_or(usual_dbm, |file| file.reception.sensitivity_dbm);
    let ((now, _), (empty, partners)) = (pooled(now), pooled(empty));
    let (mut links, mut dropped) = (Vec::new(), DroppedLinks::new());
    let all = now.iter().chain(&empty).map(|one| &one.link);
    let floor_dbm = floor_dbm(all, sensitivity_dbm);
    for one in &now {
        let partner = partners.get(&one.key).map(|index| &empty[*index]);
        match lost(one, partner, floor_dbm) {
            Ok(link) => links.push(link),
            Err(reason) => *dropped.entry(reason).or_default() += 1,
        }
    }
    (links, dropped, empty.len())
}

/// Returns what a link has lost, as an image of pixels takes it.
fn lost(now: &Pooled, partner: Option<&Pooled>, floor_dbm: f64) -> Result<VolumeLink, DropReason> {
    let strength = |one: &Pooled| one.link.censored(floor_dbm, PACKET_SD_DB);
    let now_is = strength(now).ok_or(DropReason::NeverHeard)?;
    let partner = partner.ok_or(DropReason::NoEmptyPartner)?;
    let empty_is = strength(partner).ok_or(DropReason::NoEmptyPartner)?;
    if now.link.is_silent() && partner.link.is_silent() {
        return Err(DropReason::SilentBefore);
    }
    let packets = 1.0 / now_is.packets + 1.0 / empty_is.packets;
    Ok(VolumeLink {
        from_m: now.ends[0],
        to_m: now.ends[1],
        attenuation_db: empty_is.mean_dbm - now_is.mean_dbm,
        sd_db: (PACKET_SD_DB * PACKET_SD_DB * packets + LINK_SD_DB * LINK_SD_DB).sqrt(),
        is_at_floor: now.link.is_silent(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::recording::read_recording;

    #[test]
    fn links_are_paired_by_their_places_whichever_end_comes_first() {
        let header = "tx_x_m,tx_y_m,tx_z_m,rx_x_m,rx_y_m,rx_z_m,packets,rssi_dbm\n";
        let recorded = |lines: &str| read_recording(format!("{header}{lines}").as_bytes()).unwrap();
        let now = recorded("0,0,1,9,0,2,4,-66\n0,5,1,9,5,2,4,-60\n0,0,1,9,0,3,4,-61\n");
        let empty = recorded("9,0,2,0,0,1,4,-60\n0,5,1,9,5,2,4,-60\n");
        let (links, dropped, _) = between_same_places(&now, &empty);
        let losses: Vec<f64> = links.iter().map(|link| link.attenuation_db).collect();
        assert_eq!(losses, [6.0, 0.0]);
        let expected = DroppedLinks::from([(DropReason::NoEmptyPartner, 1)]);
        assert_eq!(dropped, expected);
        assert_eq!(links[0].to_m, [9.0, 0.0, 2.0]);
    }

    #[test]
    fn links_that_come_again_are_pooled_by_their_packets_in_both_sweeps() {
        let header = "tx_x_m,tx_y_m,tx_z_m,rx_x_m,rx_y_m,rx_z_m,packets,rssi_dbm\n";
        let recorded = |lines: &str| read_recording(format!("{header}{lines}").as_bytes()).unwrap();
        let now = recorded("0,0,1,9,0,2,1,-70\n9,0,2,0,0,1,3,-66\n");
        let empty = recorded("0,0,1,9,0,2,6,-60\n0,5,1,9,5,2,4,-60\n9,0,2,0,0,1,2,-64\n");
        let (links, _, of_empty) = between_same_places(&now, &empty);
        let losses: Vec<f64> = links.iter().map(|link| link.attenuation_db).collect();
        assert_eq!((losses, of_empty), (vec![6.0], 2));
        let square_db2 =
            PACKET_SD_DB * PACKET_SD_DB * (1.0 / 4.0 + 1.0 / 8.0) + LINK_SD_DB * LINK_SD_DB;
        assert!((links[0].sd_db - square_db2.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn a_link_that_was_silenced_has_lost_what_it_had_above_the_floor() {
        let header = "tx_x_m,tx_y_m,tx_z_m,rx_x_m,rx_y_m,rx_z_m,packets,rssi_dbm,misses\n";
        let recorded = |lines: &str| read_recording(format!("{header}{lines}").as_bytes()).unwrap();
        let now = recorded("0,0,1,9,0,2,0,,7\n0,5,1,9,5,2,2,-70,6\n0,9,1,9,9,2,0,,1\n");
        let empty = recorded("9,0,2,0,0,1,4,-60,0\n0,5,1,9,5,2,4,-60,0\n0,9,1,9,9,2,4,-60,0\n");
        let (links, dropped, _) = between_same_places(&now, &empty);
        let losses: Vec<f64> = links.iter().map(|link| link.attenuation_db).collect();
        // 0.906⁷ = ½, and Φ(1.315) = 0.906. Six of eight packets that are missed 25 dB above the floor have collided.
        let expected = [35.0 + 1.315 * PACKET_SD_DB, 10.0];
        assert!(
            losses.len() == 2
                && losses
                    .iter()
                    .zip(expected)
                    .all(|(lost, of)| (lost - of).abs() < 0.01),
            "{losses:?}"
        );
        assert_eq!(dropped, DroppedLinks::from([(DropReason::NeverHeard, 1)]));
    }
}
