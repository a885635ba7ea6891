//! The report's figures of feet as one line of a table.

use oncue::figures::WholeFootFigures;

/// Stances, drift of heel and ball (median, p90), swivel (p90), swivelled; turned too far, farthest out and in; steps, heel first, toes up, clearance, heel up.
pub fn feet_row(feet: &WholeFootFigures) -> String {
    let (flat, turned, steps) = (&feet.flat, &feet.turned, &feet.steps);
    let some = |value: Option<f32>| value.map_or("–".to_owned(), |v| format!("{v:.1}"));
    format!(
        "{:4} {:.1} ({:.1}) {:.1} ({:.1}) {:4.1} {:4.1} | {:4.1} {:3.0} {:3.0} | {:4} {} {} {} {}",
        flat.stances,
        flat.heel_drift_cm.median,
        flat.heel_drift_cm.p90,
        flat.ball_drift_cm.median,
        flat.ball_drift_cm.p90,
        flat.swivel_degrees.p90,
        flat.swivelled_percent,
        turned.percent,
        turned.out_degrees,
        turned.in_degrees,
        steps.steps,
        some(steps.heel_first_percent),
        some(steps.toe_up_degrees),
        some(steps.toe_clearance_cm),
        some(steps.heel_up_degrees),
    )
}
