//! How strong a link is by its packets, and how sure that is: what packets, fades and the bins of its ends leave open.

use super::Link;
use super::censored::CensoredMean;
use super::settings::NoiseModel;

/// Of a silent link of the empty sweep only a bound is known: its level may be lower by this, dB.
const BELOW_BOUND_SD_DB: f64 = 8.0;

/// Returns the strength of a link by what was heard and missed of it.
pub(super) fn strength_of(link: &Link, noise: &NoiseModel) -> Option<CensoredMean> {
    // The packets of one spot have one fade.
    let fading_sd_db = if link.spots > 1 {
        noise.fading_sd_db
    } else {
        0.0
    };
    let square = |sd_db: f64| sd_db * sd_db;
    let packet_sd_db = (square(noise.packet_sd_db) + square(fading_sd_db)).sqrt();
    link.censored(noise.sensitivity_dbm, packet_sd_db)
}

/// Returns how much less sure the bound of a silent link is than a mean.
pub(super) fn below_bound_db2(link: &Link) -> f64 {
    if link.is_silent() {
        BELOW_BOUND_SD_DB * BELOW_BOUND_SD_DB
    } else {
        0.0
    }
}

/// s_F²/spots + s_t²/n + s_model²: without an empty sweep the fade stays in.
pub(super) fn single_variance(link: &Link, strength: CensoredMean, noise: &NoiseModel) -> f64 {
    let square = |sd_db: f64| sd_db * sd_db;
    square(noise.fading_sd_db) / f64::from(link.spots.max(1))
        + packet_variance(strength, noise)
        + square(noise.model_sd_db)
}

/// s_t²/n, and the twelfth of a step of 1 dB.
pub(super) fn packet_variance(strength: CensoredMean, noise: &NoiseModel) -> f64 {
    (noise.packet_sd_db * noise.packet_sd_db + 1.0 / 12.0) / strength.packets.max(1.0)
}

/// Returns how much more the packets of a bin differ than noise and fades make them, dB²: an edge of the structure
/// lies across the bin, and two sweeps will not sample it alike.
pub(super) fn excess_spread(link: &Link, noise: &NoiseModel) -> f64 {
    let fading_db2 = if link.spots > 1 {
        noise.fading_sd_db * noise.fading_sd_db
    } else {
        0.0
    };
    (link.spread_db * link.spread_db - noise.packet_sd_db * noise.packet_sd_db - fading_db2)
        .max(0.0)
}

/// Returns the variance of a single link whose ends were driven: what its bin hides is in it.
pub(super) fn driven_variance(link: &Link, strength: CensoredMean, noise: &NoiseModel) -> f64 {
    let excess_db2 = noise.spread_share * noise.spread_share * excess_spread(link, noise);
    single_variance(link, strength, noise) + excess_db2
}
