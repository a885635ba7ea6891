//! The normaliser before the `.bvh` parser: whatever dialect a file speaks, one plain text comes out.
//!
//! Exporters differ in line ends, letter case, braces on the joint's line, names with spaces or a
//! name-space (`mixamorig:Hips`), decimal commas and frame counts that do not match the rows. The text
//! that comes out has one keyword a line, joints named `J0`, `J1`, … in file order (their real names are
//! kept beside it), an end site at every leaf and nowhere else, and exactly as many rows as it says.

use std::fmt::Write as _;

/// More joints than any body with fingers and face has.
pub(super) const MAX_JOINTS: usize = 1000;
/// More joints below one another than any body has.
const MAX_DEPTH: usize = 200;
/// About 92 hours at 30 Hz: nobody's take, but a typical damaged or hostile count.
const MAX_FRAMES: u64 = 10_000_000;
const CHANNELS: [&str; 6] = ["Xposition", "Yposition", "Zposition", "Xrotation", "Yrotation", "Zrotation"];

/// A `.bvh` in the plain dialect.
#[derive(Debug)]
pub(super) struct NormalText {
    pub text: String,
    /// The joints' own names, trimmed, in file order.
    pub names: Vec<String>,
    /// Parent of each joint, in file order.
    pub parents: Vec<Option<usize>>,
    /// Seconds between two frames.
    pub frame_time: f64,
    pub frame_count: usize,
}

struct RawJoint {
    name: String,
    parent: Option<usize>,
    depth: usize,
    offset: Option<[f64; 3]>,
    end_site: Option<[f64; 3]>,
    channels: Vec<&'static str>,
    has_children: bool,
}

/// Rewrites the bytes of a `.bvh` in the plain dialect.
///
/// # Errors
/// A sentence (without the file's name) that says what is wrong and, where it helps, in which line.
pub(super) fn normalize(bytes: &[u8]) -> Result<NormalText, String> {
    let text = decode(bytes)?;
    if text.trim().is_empty() {
        return Err("the file is empty.".into());
    }
    let lines: Vec<&str> = text.split(['\n', '\r']).collect();
    let motion = lines.iter().position(|l| first_word(l).eq_ignore_ascii_case("motion"));
    let joints = read_hierarchy(&lines[..motion.unwrap_or(lines.len())])?;
    let Some(motion) = motion else {
        return Err("it has a skeleton but no MOTION section; the file may be cut off.".into());
    };
    let channel_count: usize = joints.iter().map(|j| j.channels.len()).sum();
    if channel_count == 0 {
        return Err("its skeleton has no channels, so nothing moves.".into());
    }
    let mut out = String::with_capacity(text.len() + 4096);
    write_hierarchy(&mut out, &joints);
    let (frame_time, frame_count) = write_motion(&mut out, &lines[motion + 1..], motion + 1, channel_count)?;
    Ok(NormalText {
        text: out,
        names: joints.iter().map(|j| j.name.clone()).collect(),
        parents: joints.iter().map(|j| j.parent).collect(),
        frame_time,
        frame_count,
    })
}

fn decode(bytes: &[u8]) -> Result<String, String> {
    let wide = |big: bool| {
        let units: Vec<u16> = bytes[2..]
            .chunks_exact(2)
            .map(|c| if big { u16::from_be_bytes([c[0], c[1]]) } else { u16::from_le_bytes([c[0], c[1]]) })
            .collect();
        String::from_utf16_lossy(&units)
    };
    match bytes {
        [0xff, 0xfe, ..] => Ok(wide(false)),
        [0xfe, 0xff, ..] => Ok(wide(true)),
        _ if bytes.contains(&0) => Err("it is a binary file, not the text of a .bvh.".into()),
        _ => {
            let bytes = bytes.strip_prefix(&[0xef, 0xbb, 0xbf]).unwrap_or(bytes);
            Ok(String::from_utf8_lossy(bytes).into_owned())
        }
    }
}

fn first_word(line: &str) -> &str {
    line.split_whitespace().next().unwrap_or("")
}

/// A number, with a decimal comma allowed.
fn number(token: &str) -> Option<f64> {
    let value = if token.contains(',') && !token.contains('.') {
        token.replacen(',', ".", 1).parse::<f64>().ok()?
    } else {
        token.parse::<f64>().ok()?
    };
    value.is_finite().then_some(value)
}

fn read_hierarchy(lines: &[&str]) -> Result<Vec<RawJoint>, String> {
    let mut joints: Vec<RawJoint> = Vec::new();
    // The open braces: a joint's index, or None for an end site.
    let mut open: Vec<Option<usize>> = Vec::new();
    // What the next opening brace belongs to.
    let mut pending: Option<Option<usize>> = None;
    let (mut seen_hierarchy, mut finished) = (false, false);
    for (line_index, whole) in lines.iter().enumerate() {
        let line_number = line_index + 1;
        let at = |what: &str| format!("line {line_number}: {what}");
        for line in pieces(whole) {
            let word = first_word(line);
            match word.to_ascii_lowercase().as_str() {
                "" => {}
                "hierarchy" => seen_hierarchy = true,
                _ if !seen_hierarchy => {
                    return Err("it does not begin with HIERARCHY, so it is not a .bvh.".into());
                }
                "root" | "joint" => {
                    let root = word.eq_ignore_ascii_case("root");
                    if root && !joints.is_empty() {
                        return Err(at("a second ROOT; one skeleton a file is supported."));
                    }
                    if pending.is_some()
                        || (root != open.is_empty())
                        || finished
                        || open.last() == Some(&None)
                    {
                        return Err(at("a joint stands where none can be."));
                    }
                    let name = line[word.len()..].trim();
                    if name.is_empty() {
                        return Err(at("a joint has no name."));
                    }
                    if joints.len() == MAX_JOINTS {
                        return Err(format!(
                            "it has more than {MAX_JOINTS} joints; a body with hands and face has about 100."
                        ));
                    }
                    if open.len() >= MAX_DEPTH {
                        return Err(format!("its joints are nested more than {MAX_DEPTH} deep."));
                    }
                    let parent = open.last().copied().flatten();
                    if let Some(parent) = parent {
                        joints[parent].has_children = true;
                    }
                    pending = Some(Some(joints.len()));
                    joints.push(RawJoint {
                        name: name.to_owned(),
                        parent,
                        depth: open.len(),
                        offset: None,
                        end_site: None,
                        channels: Vec::new(),
                        has_children: false,
                    });
                }
                "end" => {
                    if pending.is_some() || !matches!(open.last(), Some(Some(_))) {
                        return Err(at("an end site stands where none can be."));
                    }
                    pending = Some(None);
                }
                "{" => match pending.take() {
                    Some(owner) => open.push(owner),
                    None => return Err(at("an opening brace without a joint.")),
                },
                "}" => {
                    if pending.is_some() || open.pop().is_none() {
                        return Err(at("a closing brace too many."));
                    }
                    finished = open.is_empty();
                }
                "offset" => {
                    let mut numbers = line.split_whitespace().skip(1).map(number);
                    let (Some(Some(x)), Some(Some(y)), Some(Some(z))) =
                        (numbers.next(), numbers.next(), numbers.next())
                    else {
                        return Err(at("OFFSET needs three numbers."));
                    };
                    if [x, y, z].iter().any(|v| v.abs() > 1e6) {
                        return Err(at("OFFSET is too large for any unit of length."));
                    }
                    match open.last() {
                        Some(Some(joint)) => joints[*joint].offset = Some([x, y, z]),
                        // The end site belongs to the joint around it.
                        Some(None) => {
                            if let Some(Some(joint)) = open.iter().rev().nth(1) {
                                joints[*joint].end_site = Some([x, y, z]);
                            }
                        }
                        None => return Err(at("OFFSET outside a joint.")),
                    }
                }
                "channels" => {
                    let Some(Some(joint)) = open.last() else {
                        return Err(at("CHANNELS outside a joint."));
                    };
                    let mut tokens = line.split_whitespace().skip(1);
                    let count: usize = tokens
                        .next()
                        .and_then(|t| t.parse().ok())
                        .filter(|&c| c <= 6)
                        .ok_or_else(|| at("CHANNELS needs a count from 0 to 6."))?;
                    let mut channels = Vec::with_capacity(count);
                    for token in tokens {
                        let channel =
                            CHANNELS.iter().find(|c| c.eq_ignore_ascii_case(token)).ok_or_else(|| {
                                at(&format!("the channel \"{}\" is not known.", shorten(token)))
                            })?;
                        if channels.contains(channel) {
                            return Err(at("a channel is named twice."));
                        }
                        channels.push(*channel);
                    }
                    if channels.len() != count {
                        return Err(at(&format!("CHANNELS says {count} but names {}.", channels.len())));
                    }
                    joints[*joint].channels = channels;
                }
                _ => return Err(at(&format!("\"{}\" is not known.", shorten(word)))),
            }
        }
    }
    if !seen_hierarchy {
        return Err("it does not begin with HIERARCHY, so it is not a .bvh.".into());
    }
    if !finished {
        return Err("its skeleton is cut off: a brace is never closed.".into());
    }
    if let Some(joint) = joints.iter().find(|j| j.offset.is_none()) {
        return Err(format!("the joint \"{}\" has no OFFSET.", shorten(&joint.name)));
    }
    Ok(joints)
}

/// A line cut at its braces, so that `JOINT Hips {` reads as two lines. Channel and offset lines pass whole.
fn pieces(line: &str) -> impl Iterator<Item = &str> {
    let mut rest = line;
    std::iter::from_fn(move || {
        rest = rest.trim();
        if rest.is_empty() {
            return None;
        }
        let cut = match rest.find(['{', '}']) {
            Some(0) => 1,
            Some(brace) => brace,
            None => rest.len(),
        };
        let (piece, tail) = rest.split_at(cut);
        rest = tail;
        Some(piece.trim())
    })
}

fn shorten(token: &str) -> String {
    if token.chars().count() > 40 {
        token.chars().take(40).collect::<String>() + "…"
    } else {
        token.to_owned()
    }
}

fn write_hierarchy(out: &mut String, joints: &[RawJoint]) {
    out.push_str("HIERARCHY\n");
    let mut depth = 0;
    for (index, joint) in joints.iter().enumerate() {
        for _ in joint.depth..depth {
            out.push_str("}\n");
        }
        depth = joint.depth + 1;
        let [x, y, z] = joint.offset.unwrap_or_default();
        let keyword = if joint.parent.is_none() { "ROOT" } else { "JOINT" };
        // Writing to a String cannot fail.
        let _ = writeln!(out, "{keyword} J{index}\n{{\nOFFSET {x:?} {y:?} {z:?}");
        let _ = writeln!(out, "CHANNELS {} {}", joint.channels.len(), joint.channels.join(" "));
        if !joint.has_children {
            let [x, y, z] = joint.end_site.unwrap_or_default();
            let _ = writeln!(out, "End Site\n{{\nOFFSET {x:?} {y:?} {z:?}\n}}");
        }
    }
    for _ in 0..depth {
        out.push_str("}\n");
    }
}

/// Writes the MOTION section; returns the frame time in seconds and the number of rows.
fn write_motion(
    out: &mut String,
    lines: &[&str],
    first_line: usize,
    channel_count: usize,
) -> Result<(f64, usize), String> {
    let mut header = lines.iter().enumerate().filter(|(_, l)| !l.trim().is_empty());
    let stated = header
        .next()
        .and_then(|(_, line)| value_after(line, &["frames"]))
        .ok_or("its MOTION section has no line \"Frames: …\".")?;
    let stated: u64 = stated
        .parse()
        .ok()
        .filter(|&n| n <= MAX_FRAMES)
        .ok_or_else(|| format!("\"Frames: {}\" is not a possible number of frames.", shorten(stated)))?;
    let (header_end, frame_time) = header
        .next()
        .and_then(|(i, line)| value_after(line, &["frame", "time"]).map(|v| (i, v)))
        .ok_or("its MOTION section has no line \"Frame Time: …\".")?;
    let frame_time = number(frame_time).filter(|t| (1e-4..=2.0).contains(t)).ok_or_else(|| {
        format!("\"Frame Time: {}\" is not a possible time between two frames.", shorten(frame_time))
    })?;

    let rows_at = header_end + 1;
    let counts: Vec<usize> =
        lines[rows_at..].iter().map(|l| l.split_whitespace().count()).filter(|&n| n > 0).collect();
    let total: usize = counts.iter().sum();
    // Rows of the right width, the last perhaps cut off; or numbers wrapped over lines that make up all frames.
    let regular = counts
        .split_last()
        .is_none_or(|(last, rest)| rest.iter().all(|&n| n == channel_count) && *last <= channel_count);
    if !regular && total as u64 != stated.saturating_mul(channel_count as u64) {
        let bad = counts.iter().find(|&&n| n != channel_count).copied().unwrap_or_default();
        return Err(format!("a frame has {bad} numbers where the skeleton has {channel_count} channels."));
    }
    let frame_count = total / channel_count;
    if frame_count < 2 {
        return Err("it holds fewer than two whole frames.".into());
    }
    let _ = writeln!(out, "MOTION\nFrames: {frame_count}\nFrame Time: {frame_time:?}");
    let mut column = 0;
    let mut written = 0;
    for (index, line) in lines[rows_at..].iter().enumerate() {
        for token in line.split_whitespace() {
            if written == frame_count * channel_count {
                break;
            }
            let value = number(token).filter(|v| v.abs() < 1e7).ok_or_else(|| {
                format!(
                    "line {}: \"{}\" is not a usable number.",
                    first_line + rows_at + index + 1,
                    shorten(token)
                )
            })?;
            if token.contains(',') {
                let _ = write!(out, "{value:?}");
            } else {
                out.push_str(token);
            }
            written += 1;
            column += 1;
            if column == channel_count {
                out.push('\n');
                column = 0;
            } else {
                out.push(' ');
            }
        }
    }
    Ok((frame_time, frame_count))
}

/// The word after `keywords` and a colon, whatever the letter case and the spaces.
fn value_after<'a>(line: &'a str, keywords: &[&str]) -> Option<&'a str> {
    let mut words = line.split(|c: char| c.is_whitespace() || c == ':').filter(|w| !w.is_empty());
    for keyword in keywords {
        if !words.next()?.eq_ignore_ascii_case(keyword) {
            return None;
        }
    }
    words.next()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const PLAIN: &str = "HIERARCHY\nROOT Hips\n{\nOFFSET 0 0 0\nCHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\nJOINT Head\n{\nOFFSET 0 10 0\nCHANNELS 3 Zrotation Xrotation Yrotation\nEnd Site\n{\nOFFSET 0 5 0\n}\n}\n}\nMOTION\nFrames: 2\nFrame Time: 0.0333333\n0 1 2 3 4 5 6 7 8\n0 1 2 3 4 5 6 7 9\n";

    #[test]
    fn dialects_read_alike() {
        let plain = normalize(PLAIN.as_bytes()).unwrap();
        assert_eq!(plain.names, ["Hips", "Head"]);
        assert_eq!(plain.frame_count, 2);
        let mut dialects = vec![
            PLAIN.replace('\n', "\r\n"),
            PLAIN.replace('\n', "\r"),
            format!("\u{feff}{PLAIN}"),
            PLAIN.to_lowercase().replace("hips", "Hips").replace("head", "Head"),
            PLAIN.to_uppercase().replace("HIPS", "Hips").replace("HEAD", "Head"),
            PLAIN.replace("\n{", " {").replace(' ', "\t"),
            PLAIN.replace("Frames: 2", "Frames: 7"),
            PLAIN.replace("Frames: 2", "Frames:1"),
            PLAIN.replace("0.0333333", "0,0333333"),
            format!("{PLAIN}0 1 2"),
            PLAIN.replace("4 5 6 7 8\n", "4\n5 6 7 8\n"),
        ];
        let utf16: Vec<u8> =
            [0xff, 0xfe].into_iter().chain(PLAIN.encode_utf16().flat_map(u16::to_le_bytes)).collect();
        assert_eq!(normalize(&utf16).unwrap().text, plain.text);
        for dialect in &mut dialects {
            assert_eq!(normalize(dialect.as_bytes()).unwrap().text, plain.text, "{dialect}");
        }
        let named = PLAIN.replace("Head", "mixamorig:Left Up Leg");
        assert_eq!(normalize(named.as_bytes()).unwrap().names[1], "mixamorig:Left Up Leg");
    }

    #[test]
    fn damage_gets_a_sentence() {
        let cases: [(String, &str); 15] = [
            (String::new(), "empty"),
            ("  \n ".into(), "empty"),
            ("\0\u{1}binary".into(), "binary"),
            ("Hello world".into(), "not a .bvh"),
            (PLAIN[..35].into(), "cut off"),
            (PLAIN.split("MOTION").next().unwrap().into(), "no MOTION"),
            (PLAIN.replace("Frames: 2", "Frames: -1"), "possible number of frames"),
            (PLAIN.replace("Frames: 2", "Frames: 10000000000"), "possible number of frames"),
            (PLAIN.replace("0.0333333", "0"), "possible time"),
            (PLAIN.replace("0.0333333", "nan"), "possible time"),
            (PLAIN.replace("7 9", "NaN 9"), "\"NaN\" is not a usable number"),
            (PLAIN.replace("7 9", "7 9 10 11"), "channels"),
            (PLAIN.replace("OFFSET 0 10 0", ""), "no OFFSET"),
            (
                PLAIN.replace("Zrotation Xrotation Yrotation\nEnd", "Zrotation Xrotation Wrotation\nEnd"),
                "Wrotation",
            ),
            (PLAIN.replace("0 1 2 3 4 5 6 7 8\n0 1 2 3 4 5 6 7 9\n", ""), "fewer than two"),
        ];
        for (text, part) in cases {
            let reason = normalize(text.as_bytes()).unwrap_err();
            assert!(reason.contains(part) && reason.ends_with('.'), "{reason} / {part}");
        }
        let nested =
            format!("HIERARCHY\nROOT a\n{{\nOFFSET 0 0 0\n{}", "JOINT a\n{\nOFFSET 0 0 0\n".repeat(5000));
        assert!(normalize(nested.as_bytes()).unwrap_err().contains("nested"));
        let wide = format!(
            "HIERARCHY\nROOT a\n{{\nOFFSET 0 0 0\n{}",
            "JOINT a\n{\nOFFSET 0 0 0\n}\n".repeat(100_000)
        );
        assert!(normalize(wide.as_bytes()).unwrap_err().contains("more than 1000 joints"));
    }

    proptest! {
        #[test]
        fn no_bytes_panic(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
            let _ = normalize(&bytes);
        }

        #[test]
        fn no_damage_panics(at in 0usize..300, cut in 0usize..300, put in "[ -~\n]{0,12}") {
            let (at, cut) = (at.min(PLAIN.len()), cut.min(PLAIN.len()));
            let (a, b) = (at.min(cut), at.max(cut));
            let _ = normalize(format!("{}{put}{}", &PLAIN[..a], &PLAIN[b..]).as_bytes());
        }
    }
}
