//! Diagrams of spring arms: error against time.
//!
//! One per arm, stiffness and frame rate, with the same axes.

use super::diagram::{Diagram, Joined, Point, Series};
use super::figure::{Axis, Figure, is_drawn, picture};
use super::palette::Look;
use super::text;
use crate::drift::{ArmPoint, ArmReport};

/// Time and error, if the point has both.
fn at(point: &ArmPoint) -> Option<[f64; 2]> {
    // A logarithmic axis has no zero.
    let at = [
        point.us_per_second?.value * 1e3,
        point.position_error?.max(1e-16),
    ];
    at.iter().all(|value| is_drawn(*value)).then_some(at)
}

pub fn figures(report: &ArmReport) -> Vec<Figure> {
    let places = || report.points.iter().filter_map(at);
    let settings = report.points.chunk_by(|a, b| a.setting == b.setting);
    let figure = |points: &[ArmPoint]| {
        let setting = points[0].setting;
        let (arm, k, rate) = (setting.arm.name(), setting.stiffness, setting.rate_hz);
        let methods = points.chunk_by(|a, b| a.method == b.method);
        let series = methods.map(|own| {
            let nth = report.methods.iter().position(|m| m.name == own[0].method);
            let point = |point: &ArmPoint| {
                let wide = point.us_per_second.and_then(|us| us.lower.zip(us.upper));
                let wide = wide.map(|(low, high)| [low * 1e3, high * 1e3]);
                Some(Point {
                    at: at(point)?,
                    wide,
                    note: format!("{}, {} steps per frame", point.method, point.substeps),
                    ..Point::default()
                })
            };
            Series {
                name: own[0].method.to_owned(),
                look: Look::nth(nth.unwrap_or(0)),
                is_scan: false,
                points: own.iter().filter_map(point).collect(),
            }
        });
        let error = |error: f64| format!("{error:.0e}");
        let title = "CPU time per simulated second";
        let caption = format!("{arm} arm, k = {k:e}/s2, {rate} Hz: position error against time");
        let axes = [
            Axis::log(title, places().map(|p| p[0]), 1.2, &text::time),
            Axis::log("", places().map(|p| p[1]), 2.0, &error),
        ];
        let series = series.filter(|series| !series.points.is_empty()).collect();
        Diagram::of(caption, axes, Joined::Marked, series).draw()
    };
    settings.map(figure).collect()
}

/// All as one picture: a row per arm and stiffness, a column per rate.
pub fn draw(report: &ArmReport) -> String {
    let mut rates: Vec<f64> = report.points.iter().map(|p| p.setting.rate_hz).collect();
    rates.sort_by(f64::total_cmp);
    rates.dedup();
    picture(&figures(report), rates.len().max(1))
}
