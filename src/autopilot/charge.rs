//! How the charge of a battery is written in recordings and snapshots: a share from 0 to 1, and -1 when it is not known, as
//! autopilots say it themselves.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// What is written for a charge that is not known.
const UNKNOWN: f64 = -1.0;

/// Writes a charge.
pub(crate) fn serialize<S: Serializer>(
    charge: &Option<f64>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    charge.unwrap_or(UNKNOWN).serialize(serializer)
}

/// Reads a charge.
pub(crate) fn deserialize<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Option<f64>, D::Error> {
    let charge = f64::deserialize(deserializer)?;
    Ok((charge >= 0.0).then_some(charge))
}

#[cfg(test)]
mod tests {
    use crate::autopilot::AutopilotReport;
    use crate::autopilot::tests_support::resting_report;

    #[test]
    fn a_charge_is_written_as_a_number_whether_it_is_known_or_not() {
        for (battery, written) in [
            (Some(0.5), "\"battery\":0.5,"),
            (Some(0.0), "\"battery\":0.0,"),
            (None, "\"battery\":-1.0,"),
        ] {
            let report = AutopilotReport {
                battery,
                ..resting_report()
            };
            let text = serde_json::to_string(&report).unwrap();
            assert!(text.contains(written), "{text}");
            let read: AutopilotReport = serde_json::from_slice(text.as_bytes()).unwrap();
            assert_eq!(read, report);
        }
    }
}
