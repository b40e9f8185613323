//! What `tomoswarm image` prints: links, finds, peaks, and what made a pixel. It reads and writes nothing.

use tomoswarm_proto::VehicleId;

use super::recording::LengthUnit;
use crate::tomo::{
    DeviceOffsets, DropReason, DroppedLinks, Find, Finds, PixelShares, Reconstruction, SIGNIFICANT,
};

/// Links of a pixel that the summary names.
const SHARES_SHOWN: usize = 5;

/// Returns who was found, in lines; or the best place, which is no find.
fn finds_in_words(finds: &Finds, unit: &str) -> String {
    let place = |find: &Find| {
        let [xx, _, yy] = find.covariance_m2;
        format!(
            "({:.2} ± {:.2}, {:.2} ± {:.2}) {unit}: {:.1} dB/{unit}, evidence {:.1}",
            find.at.x_m,
            xx.sqrt(),
            find.at.y_m,
            yy.sqrt(),
            find.strength,
            find.evidence
        )
    };
    let found = finds.found.iter();
    let text: String = found
        .map(|find| format!("found at {}\n", place(find)))
        .collect();
    match &finds.next {
        _ if !finds.found.is_empty() => text,
        Some(next) if next.evidence >= finds.threshold => format!(
            "somebody is there, but the links cannot tell where; the best place is at {}, of {:.1} that are needed\n",
            place(next),
            finds.threshold
        ),
        Some(next) => format!(
            "nobody found; the best place is at {}, of {:.1} that are needed, probability {:.3}\n",
            place(next),
            finds.threshold,
            next.probability
        ),
        None => "nobody found\n".to_owned(),
    }
}

/// Returns the links that made a pixel, in lines; the strongest few of them.
fn shares_in_words(shares: &PixelShares, unit: &str) -> String {
    let (at, links) = (shares.at, &shares.links);
    let mut text = format!(
        "pixel at ({:.2}, {:.2}) {unit}: {:.3} dB/{unit}, of {} links; most by\n",
        at.x_m,
        at.y_m,
        shares.value,
        links.len()
    );
    for link in links.iter().take(SHARES_SHOWN) {
        text += &format!(
            "  ({:.2}, {:.2}) to ({:.2}, {:.2}): {:+.3}, lost {:.1} ± {:.1} dB, {:+.1} dB unexplained\n",
            link.from.x_m,
            link.from.y_m,
            link.to.x_m,
            link.to.y_m,
            link.share,
            link.attenuation_db,
            link.sd_db,
            link.residual_db
        );
    }
    text
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

/// Returns how many links were left out, in a line for each reason.
pub(super) fn dropped_in_words(dropped: &DroppedLinks) -> String {
    let line =
        |(reason, count): (&DropReason, &usize)| format!("  {count} dropped: {}\n", reason.words());
    dropped.iter().map(line).collect()
}

/// Returns the summary; `counts` are the links of the files and what is left of them when they are pooled. Those used
/// and those dropped are as many as the latter.
pub(super) fn summary(result: &Reconstruction, counts: (usize, usize), unit: LengthUnit) -> String {
    let unit = unit.word();
    let of = match counts {
        (read, pooled) if read == pooled => format!("{read}"),
        (read, pooled) => format!("{read} pooled to {pooled}"),
    };
    let mut text = format!(
        "links: {of}, {} used, residual {:.2} dB\n",
        result.used, result.residual_rms_db
    );
    text += &dropped_in_words(&result.dropped);
    if let Some(choice) = &result.choice {
        text += &format!("{}\n", choice.words());
    }
    match &result.finds {
        Some(finds) => text += &finds_in_words(finds, unit),
        None if result.by_empty_sweep => {
            text += "persons are not searched: nothing of the area is far enough from its border, and between links\n";
        }
        None => {}
    }
    if let Some(shares) = &result.shares {
        text += &shares_in_words(shares, unit);
    }
    for peak in &result.peaks {
        let faint = if peak.is_faint() {
            format!(" (faint: under {SIGNIFICANT} it may be noise)")
        } else {
            String::new()
        };
        // An image that is zero nearly everywhere has no noise to compare with.
        let ratio = match peak.significance {
            f64::MAX => String::new(),
            ratio => format!(", {ratio:.1} times the noise"),
        };
        text += &format!(
            "peak at ({:.2}, {:.2}) {unit}: {:.2} dB/{unit}{ratio}{faint}\n",
            peak.at.x_m, peak.at.y_m, peak.strength
        );
    }
    text
}
