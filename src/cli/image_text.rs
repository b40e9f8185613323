//! What `tomoswarm image` prints: links, finds, peaks, and what made a pixel. It reads and writes nothing.

use tomoswarm_proto::VehicleId;

use super::counted::counted;
use super::recording::LengthUnit;
use super::reference::Reference;
use crate::geom::Rect;
use crate::tomo::{
    DeviceOffsets, DropReason, DroppedLinks, Find, FindSettings, Finds, ImagingSettings, Peak,
    PixelShares, Reconstruction, SIGNIFICANT,
};

/// Strengths under this are printed as 0.00, and are no peaks to a reader.
pub(super) const LEAST_SHOWN: f64 = 0.005;
/// Links of a pixel that the summary names.
const SHARES_SHOWN: usize = 5;

/// Returns who was found, in lines; or the best place, which is no find. No deviation is shown that is larger than the `area`,
/// since a person stands in it.
fn finds_in_words(finds: &Finds, settings: &FindSettings, area: Rect, unit: &str) -> String {
    let found = finds.found.iter();
    let text: String = found
        .map(|find| format!("found at {}\n", place_in_words(find, area, unit)))
        .collect();
    let unfound = unfound_in_words(finds, settings, area, unit);
    let unfound = unfound.map_or(String::new(), |unfound| unfound + "\n");
    let limit = limit_in_words(finds.threshold, finds.false_per_image);
    format!("{text}{unfound}{limit}\n")
}

/// Returns from which evidence on somebody is a find, and how often that is nobody.
pub(super) fn limit_in_words(threshold: f64, false_per_image: f64) -> String {
    format!(
        "evidence of {threshold:.1} is needed: {false_per_image} finds of nobody in an image, on the mean"
    )
}

/// Returns in words who is there and cannot be found, or that nobody is found, with the best place, which is no find;
/// `None` where everybody is found.
pub(super) fn unfound_in_words(
    finds: &Finds,
    settings: &FindSettings,
    area: Rect,
    unit: &str,
) -> Option<String> {
    let place = |find: &Find| place_in_words(find, area, unit);
    if let Some(next) = finds.unlocated(settings) {
        let who = match finds.found.is_empty() {
            true => "somebody",
            false => "somebody else",
        };
        return Some(format!(
            "{who} is there, but the links cannot tell where; the best place is at {}, of {:.1} that are needed",
            place(next),
            finds.threshold
        ));
    }
    match &finds.next {
        _ if !finds.found.is_empty() => None,
        Some(next) => Some(format!(
            "nobody found; the best place is at {}, of {:.1} that are needed, probability {:.3}",
            place(next),
            finds.threshold,
            next.probability
        )),
        None => Some("nobody found".to_owned()),
    }
}

fn place_in_words(find: &Find, area: Rect, unit: &str) -> String {
    let [xx, _, yy] = find.covariance_m2;
    format!(
        "({:.2} ± {:.2}, {:.2} ± {:.2}) {unit}: {:.1} dB/{unit}, evidence {:.1}",
        find.at.x_m,
        xx.sqrt().min(area.width_m()),
        find.at.y_m,
        yy.sqrt().min(area.height_m()),
        find.strength,
        find.evidence
    )
}

/// Returns why persons were not searched in a change that was imaged.
pub(super) fn why_not_searched(settings: &FindSettings, area: Rect, unit: &str) -> String {
    let rim = settings.rim_m.max(settings.person.radius_m);
    match area.width_m().min(area.height_m()) > 2.0 * rim {
        true => "the links tell no place of the area from another".to_owned(),
        false => format!(
            "nobody is sought within {rim:.2} {unit} of the border, which is all of an area of {:.2} x {:.2} {unit}",
            area.width_m(),
            area.height_m()
        ),
    }
}

/// Returns the links that made a pixel, in lines; the strongest few of them.
fn shares_in_words(shares: &PixelShares, unit: &str) -> String {
    let (at, links) = (shares.at, &shares.links);
    let mut text = format!(
        "pixel at ({:.2}, {:.2}) {unit}: {:.3} dB/{unit}, of {}; most by\n",
        at.x_m,
        at.y_m,
        shares.value,
        counted(links.len(), "link")
    );
    for link in links.iter().take(SHARES_SHOWN) {
        text += &format!(
            "  ({:.2}, {:.2}) to ({:.2}, {:.2}): {:+.3}, lost {:.1} ± {:.1} dB by {}, {:+.1} dB unexplained\n",
            link.from.x_m,
            link.from.y_m,
            link.to.x_m,
            link.to.y_m,
            link.share,
            link.attenuation_db,
            link.sd_db,
            packets_in_words(link.packets, link.misses),
            link.residual_db
        );
    }
    text
}

/// Returns how many packets were heard, and how many missed where any were.
fn packets_in_words(packets: u32, misses: u32) -> String {
    let heard = counted(packets as usize, "packet");
    match misses {
        0 => heard,
        _ => format!("{heard} ({misses} missed)"),
    }
}

/// Returns by how much radios differ, in a line.
pub(super) fn offsets_in_words(offsets: &DeviceOffsets) -> String {
    let of = |(id, sent_db, heard_db): (VehicleId, f64, f64)| {
        format!("{id} sends {sent_db:+.1} and hears {heard_db:+.1}")
    };
    let all: Vec<String> = offsets.list().into_iter().map(of).collect();
    format!(
        "radios differ, which is taken out, dB: {}\n",
        all.join("; ")
    )
}

/// Returns how many links were left out, in a line for each reason; `shortest` says under which length a link is too short,
/// where any is.
pub(super) fn dropped_in_words(dropped: &DroppedLinks, shortest: &str) -> String {
    let line = |(reason, count): (&DropReason, &usize)| {
        let more = match reason {
            DropReason::TooShort => format!(": under {shortest}"),
            DropReason::SameSide
            | DropReason::NeverHeard
            | DropReason::NoEmptyPartner
            | DropReason::NoPathLoss
            | DropReason::OutsideArea
            | DropReason::SilentBefore => String::new(),
        };
        format!("  {count} dropped: {}{more}\n", reason.words())
    };
    dropped.iter().map(line).collect()
}

/// How many links there are.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct LinkCounts {
    /// In the files, each sample once.
    pub(super) read: usize,
    /// Samples that were left out because they had been given already, those of the empty sweep, too.
    pub(super) repeated: usize,
    /// What is left of them when they are pooled: those used and those dropped together.
    pub(super) pooled: usize,
    /// Those of the empty sweep, pooled, where there is one.
    pub(super) empty: Option<usize>,
}

/// Returns the summary.
pub(super) fn summary(
    result: &Reconstruction,
    counts: LinkCounts,
    unit: LengthUnit,
    settings: &ImagingSettings,
) -> String {
    let (unit, area) = (unit.word(), result.image.grid.area);
    let LinkCounts {
        read,
        repeated,
        pooled,
        empty,
    } = counts;
    let of = match read == pooled {
        true => format!("{read}"),
        false => format!("{read} pooled to {pooled}"),
    };
    let mut text = format!(
        "links: {of}, {} used, residual {:.2} dB\n",
        result.used, result.residual_rms_db
    );
    text += &match repeated {
        0 => String::new(),
        count => format!("  {} left out: given already\n", counted(count, "sample")),
    };
    let shortest = format!("{:.2} {unit}", settings.shortest_link_m);
    text += &dropped_in_words(&result.dropped, &shortest);
    text += &Reference::of(empty, result.path_loss).map_or(String::new(), Reference::in_words);
    if let Some(choice) = &result.choice {
        text += &format!("{}\n", choice.words());
    }
    match &result.finds {
        Some(finds) => text += &finds_in_words(finds, &settings.finds, area, unit),
        None if result.by_empty_sweep => {
            let why = why_not_searched(&settings.finds, area, unit);
            text += &format!("persons are not searched: {why}\n");
        }
        None => {}
    }
    if let Some(shares) = &result.shares {
        text += &shares_in_words(shares, unit);
    }
    text + &peaks_in_words(&result.peaks, unit)
}

/// Returns the peaks, in lines.
fn peaks_in_words(peaks: &[Peak], unit: &str) -> String {
    let words = |peak: &Peak| {
        let faint = if peak.is_faint() {
            format!(" (faint: under {SIGNIFICANT} it may be noise)")
        } else {
            String::new()
        };
        // An image that is zero nearly everywhere has no noise to compare with.
        let ratio = peak.significance.map_or(String::new(), |ratio| {
            format!(", {ratio:.1} times the noise")
        });
        format!(
            "peak at ({:.2}, {:.2}) {unit}: {:.2} dB/{unit}{ratio}{faint}\n",
            peak.at.x_m, peak.at.y_m, peak.strength
        )
    };
    let shown: String = peaks
        .iter()
        .filter(|peak| peak.strength >= LEAST_SHOWN)
        .map(words)
        .collect();
    match (shown.is_empty(), peaks.is_empty()) {
        (true, false) => format!("no peak: nothing reaches {LEAST_SHOWN} dB/{unit}\n"),
        (false, _) | (true, true) => shown,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::Point;

    const AREA: Rect = Rect {
        min: Point::new(0.0, 0.0),
        max: Point::new(20.0, 10.0),
    };

    fn words(found: Vec<Find>, next: Find) -> String {
        let finds = Finds {
            found,
            next: Some(next),
            threshold: 4.9,
            false_per_image: 0.02,
        };
        finds_in_words(&finds, &FindSettings::IN_METRES, AREA, "m")
    }

    #[test]
    fn somebody_who_may_stand_anywhere_is_told_from_nobody() {
        let find = |evidence: f64, sd_m: f64| Find {
            at: Point::new(3.0, 4.0),
            strength: 8.0,
            covariance_m2: [sd_m * sd_m, 0.0, sd_m * sd_m],
            evidence,
            probability: 1.0,
        };
        let somebody = words(Vec::new(), find(12.8, 70.0));
        assert_eq!(
            somebody,
            "somebody is there, but the links cannot tell where; the best place is at (3.00 ± 20.00, 4.00 ± 10.00) m: \
             8.0 dB/m, evidence 12.8, of 4.9 that are needed\n\
             evidence of 4.9 is needed: 0.02 finds of nobody in an image, on the mean\n"
        );
        let more = words(vec![find(30.0, 0.1)], find(12.8, 70.0));
        assert!(
            more.contains("found at (3.00 ± 0.10") && more.contains("somebody else is there"),
            "{more}"
        );
        let nobody = words(Vec::new(), find(3.0, 70.0));
        assert!(nobody.starts_with("nobody found; "), "{nobody}");
        let one = words(vec![find(30.0, 0.1)], find(3.0, 70.0));
        assert!(one.starts_with("found at ") && one.lines().count() == 2);
    }

    #[test]
    fn peaks_that_would_read_as_zero_are_not_named() {
        let peak = |strength: f64| Peak {
            at: Point::new(3.0, 4.0),
            strength,
            significance: None,
        };
        assert_eq!(
            peaks_in_words(&[peak(0.5), peak(1e-9)], "m"),
            "peak at (3.00, 4.00) m: 0.50 dB/m\n"
        );
        assert_eq!(
            peaks_in_words(&[peak(0.004)], "m"),
            "no peak: nothing reaches 0.005 dB/m\n"
        );
        assert_eq!(peaks_in_words(&[], "m"), "");
    }

    #[test]
    fn links_that_are_too_short_are_told_how_long_they_should_be() {
        let dropped = DroppedLinks::from([(DropReason::TooShort, 3), (DropReason::SameSide, 2)]);
        let said = dropped_in_words(&dropped, "1.50 m");
        assert_eq!(
            said,
            "  3 dropped: too short: under 1.50 m\n  2 dropped: along one side\n"
        );
    }

    #[test]
    fn why_persons_are_not_searched_is_said() {
        let said = |width_m: f64| {
            let area = Rect::new(Point::default(), Point::new(width_m, 9.0));
            why_not_searched(&FindSettings::IN_METRES, area, "m")
        };
        assert!(
            said(1.5)
                .contains("within 0.80 m of the border, which is all of an area of 1.50 x 9.00 m")
        );
        assert!(said(8.0).contains("the links tell no place"));
    }
}
