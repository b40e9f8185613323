//! Samples as CSV, one beacon heard or missed a line: what `tomoswarm sim --samples`, `tomoswarm export` and the operator's
//! page write, and `tomoswarm image` reads.

use std::fmt::Write;

use tomoswarm_proto::{Boot, PoseReport, RunId, Sample, VehicleId};

/// The header of a file of samples.
pub const SAMPLES_HEADER: &str = "vehicle,boot,run,sequence,heard_at_s,utc,utc_error_s,transmitter,\
    tx_x_m,tx_y_m,tx_z_m,tx_heading_rad,tx_sd_m,rx_x_m,rx_y_m,rx_z_m,rx_heading_rad,rx_sd_m,\
    channel,power_dbm,rssi_dbm";

/// A sample, by whom it was measured and when, as a line says it.
#[derive(Clone, Copy, Debug)]
pub struct SampleLine<'a> {
    /// Who measured.
    pub vehicle: VehicleId,
    /// Start of its software.
    pub boot: Boot,
    /// In which run.
    pub run: RunId,
    /// What was measured.
    pub sample: &'a Sample,
    /// When, seconds since 1970, and its deviation, as far as known.
    pub utc_s: Option<(f64, f64)>,
}

impl SampleLine<'_> {
    /// Appends the line; what is not known is empty.
    pub fn write(&self, text: &mut String) {
        let SampleLine {
            vehicle,
            boot,
            run,
            sample,
            utc_s,
        } = self;
        let (utc, error) = utc_s.map_or_else(Default::default, |(utc_s, error_s)| {
            (utc_text(utc_s), format!("{error_s:.3}"))
        });
        let heard_at_s = sample.heard_at_ns as f64 / 1e9;
        let (tx, rx) = (
            pose_fields(&sample.transmitter_pose),
            pose_fields(&sample.receiver_pose),
        );
        let rssi = sample
            .rssi_dbm
            .map(|rssi_dbm| rssi_dbm.to_string())
            .unwrap_or_default();
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "{vehicle},{boot},{run},{},{heard_at_s:.6},{utc},{error},{},{tx},{rx},{},{},{rssi}",
            sample.sequence, sample.transmitter, sample.channel, sample.power_dbm
        );
    }
}

fn pose_fields(pose: &PoseReport) -> String {
    let PoseReport { at, heading, sd } = pose;
    let known = |value: f64, digits: usize| match value.is_finite() {
        true => format!("{value:.digits$}"),
        false => String::new(),
    };
    let place = [at.x_m(), at.y_m(), at.z_m()].map(|metres| known(metres, 4));
    let sd_m = known(sd.metres().unwrap_or(f64::NAN), 4);
    format!("{},{},{sd_m}", place.join(","), known(heading.radians(), 5))
}

/// Returns a moment in UTC as ISO 8601 with milliseconds ("2026-11-20T09:05:00.250Z"); empty for what is no time.
pub fn utc_text(utc_s: f64) -> String {
    let millis = (utc_s * 1e3).round();
    if !(0.0..253_402_300_800_000.0).contains(&millis) {
        return String::new();
    }
    let millis = millis as u64;
    let (days, of_day) = (millis / 86_400_000, millis % 86_400_000);
    let (year, month, day) = civil(days);
    let (hour, minute) = (of_day / 3_600_000, of_day / 60_000 % 60);
    let (second, milli) = (of_day / 1000 % 60, of_day % 1000);
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}.{milli:03}Z")
}

/// Returns the date of a day counted from 1970-01-01 (Hinnant, "chrono-compatible low-level date algorithms").
fn civil(days: u64) -> (u64, u64, u64) {
    let shifted = days + 719_468;
    let (era, of_era) = (shifted / 146_097, shifted % 146_097);
    let year = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year + year / 4 - year / 100);
    let month = (5 * of_year + 2) / 153;
    let day = of_year - (153 * month + 2) / 5 + 1;
    let month = if month < 10 { month + 3 } else { month - 9 };
    (year + era * 400 + u64::from(month <= 2), month, day)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_are_written_as_iso_8601() {
        assert_eq!(utc_text(0.0), "1970-01-01T00:00:00.000Z");
        assert_eq!(utc_text(951_782_399.25), "2000-02-28T23:59:59.250Z");
        assert_eq!(utc_text(951_782_400.0), "2000-02-29T00:00:00.000Z");
        assert_eq!(utc_text(4_107_542_399.999_6), "2100-03-01T00:00:00.000Z");
        assert_eq!(utc_text(1_700_000_000.0), "2023-11-14T22:13:20.000Z");
        assert_eq!(
            (utc_text(-1.0), utc_text(f64::NAN)),
            (String::new(), String::new())
        );
    }
}
