//! The picture of `cullbench funnel`: the first view from above, every item in the
//! colour of the stage that removed it.

use plotters::prelude::*;

use super::chart::{Area, Drawn, legend, svg};
use super::text;
use crate::funnel::{Fate, FunnelReport, PlanView, StageKind};

/// The plan itself is square: less the margins, the labels and the caption.
const SIZE: (u32, u32) = (900, 892);

/// Every fate that is drawn, with its colour and its words.
const FATES: [(Fate, RGBColor, &str); 6] = [
    (
        Fate::Removed(StageKind::Region),
        RGBColor(225, 225, 225),
        "region: not reached through portals",
    ),
    (
        Fate::Removed(StageKind::Object),
        RGBColor(200, 205, 210),
        "object: outside of the frustum",
    ),
    (
        Fate::Removed(StageKind::Occlusion),
        RGBColor(240, 200, 140),
        "occlusion: behind others",
    ),
    (Fate::Kept, RGBColor(86, 180, 233), "drawn, and not visible"),
    (Fate::Visible, RGBColor(0, 130, 90), "visible"),
    (Fate::Lost, RGBColor(213, 0, 0), "visible, and removed"),
];

/// The picture as SVG.
pub fn draw(report: &FunnelReport) -> anyhow::Result<String> {
    svg("the picture", SIZE, |root| draw_on(root, report))
}

fn draw_on(root: &Area, report: &FunnelReport) -> Drawn {
    let plan = &report.plan_view;
    let reach = reach(plan);
    let [x, y] = plan.eye;
    let mut chart = ChartBuilder::on(root)
        .caption(
            text::plain(&format!(
                "{}, {}: the first view from above",
                report.scene, report.path
            )),
            ("sans-serif", 18),
        )
        .margin(12)
        .x_label_area_size(32)
        .y_label_area_size(64)
        .build_cartesian_2d(x - reach..x + reach, y - reach..y + reach)?;
    chart
        .configure_mesh()
        .disable_mesh()
        .x_labels(5)
        .y_labels(5)
        .draw()?;
    for (fate, colour, words) in FATES {
        let corners = plan.items.iter().filter(|(_, own)| *own == fate);
        let mut boxes = corners
            .map(|([x0, y0, x1, y1], _)| Rectangle::new([(*x0, *y0), (*x1, *y1)], colour.filled()))
            .peekable();
        if boxes.peek().is_none() {
            continue;
        }
        chart
            .draw_series(boxes)?
            .label(words)
            .legend(move |(x, y)| Rectangle::new([(x, y - 5), (x + 14, y + 5)], colour.filled()));
    }
    for [dx, dy] in plan.edges {
        // A point beyond the picture would be clamped to its border, which turns the line.
        let far = reach / dx.abs().max(dy.abs()).max(f64::MIN_POSITIVE);
        let line = [(x, y), (x + dx * far, y + dy * far)];
        chart.draw_series([PathElement::new(line, BLACK.stroke_width(1))])?;
    }
    chart.draw_series([Circle::new((x, y), 4, BLACK.filled())])?;
    legend(&mut chart, SeriesLabelPosition::UpperLeft)
}

/// Half of the side of what is drawn: all items, but never without an extent.
fn reach(plan: &PlanView) -> f64 {
    let [x, y] = plan.eye;
    let corners = plan.items.iter().map(|(corners, _)| {
        let middle = [
            (corners[0] + corners[2]) / 2.0,
            (corners[1] + corners[3]) / 2.0,
        ];
        (middle[0] - x).abs().max((middle[1] - y).abs())
    });
    let reach = corners.fold(0.0, f64::max);
    match reach.is_finite() && reach > 0.0 {
        true => reach,
        false => 1.0,
    }
}
