//! Venue, scene and simulation files: raw serde twins and the validated types behind them.
