//! The text of a `.bvh`, in whatever dialect it speaks.
//!
//! Exporters differ in line ends, letter case, braces on the joint's line, names with spaces or a
//! name-space (`mixamorig:Hips`), decimal commas and frame counts that do not match the rows. Files come from
//! strangers, so every count has a limit, and numbers are read by the standard library alone.

use std::borrow::Cow;

/// More joints than any body with fingers and face has.
pub(super) const MAX_JOINTS: usize = 1000;
/// More joints below one another than any body has.
const MAX_DEPTH: usize = 200;
/// About 92 hours at 30 Hz: nobody's take, but a typical damaged or hostile count.
const MAX_FRAMES: u64 = 10_000_000;
/// Positions along X, Y and Z, then rotations about them.
const CHANNELS: [&str; 6] = ["Xposition", "Yposition", "Zposition", "Xrotation", "Yrotation", "Zrotation"];

/// What a `.bvh` says.
#[derive(Debug, Clone, PartialEq)]
pub struct MocapText {
    /// In file order, parents before children.
    pub joints: Vec<JointText>,
    /// Seconds between two frames.
    pub frame_time: f64,
    /// Numbers of one frame.
    pub channel_count: usize,
    /// Row by row, whole frames, two at least.
    pub values: Vec<f32>,
}

/// One joint of the HIERARCHY.
#[derive(Debug, Clone, PartialEq)]
pub struct JointText {
    /// Trimmed, otherwise as the file spells it.
    pub name: String,
    pub parent: Option<usize>,
    pub offset: [f32; 3],
    /// Every leaf has one, zero where the file has none; no other joint does.
    pub end_site: Option<[f32; 3]>,
    /// Index into X, Y, Z and X, Y, Z of each of its channels, in the file's order.
    pub channels: Vec<Channel>,
}

/// What a column of the MOTION section is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Channel {
    /// Along axis 0, 1 or 2.
    Position(usize),
    /// About axis 0, 1 or 2.
    Rotation(usize),
}

/// A joint whose braces are not closed yet.
struct OpenJoint {
    name: String,
    parent: Option<usize>,
    offset: Option<[f32; 3]>,
    end_site: Option<[f32; 3]>,
    channels: Vec<Channel>,
    has_children: bool,
}

/// Reads the bytes of a `.bvh`.
///
/// # Errors
/// A sentence (without the file's name) that says what is wrong and, where it helps, in which line.
pub(super) fn read(bytes: &[u8]) -> Result<MocapText, String> {
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
    let (frame_time, values) = read_motion(&lines[motion + 1..], motion + 1, channel_count)?;
    Ok(MocapText { joints, frame_time, channel_count, values })
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

/// A number's text, with a decimal point where it had a comma.
fn decimal(token: &str) -> Cow<'_, str> {
    if token.contains(',') && !token.contains('.') {
        token.replacen(',', ".", 1).into()
    } else {
        token.into()
    }
}

/// The `f32` nearest to what is written.
fn number(token: &str) -> Option<f32> {
    decimal(token).parse().ok().filter(|v: &f32| v.is_finite())
}

fn read_hierarchy(lines: &[&str]) -> Result<Vec<JointText>, String> {
    let mut joints: Vec<OpenJoint> = Vec::new();
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
                    joints.push(OpenJoint {
                        name: name.to_owned(),
                        parent,
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
                        let index =
                            CHANNELS.iter().position(|c| c.eq_ignore_ascii_case(token)).ok_or_else(|| {
                                at(&format!("the channel \"{}\" is not known.", shorten(token)))
                            })?;
                        let channel =
                            if index < 3 { Channel::Position(index) } else { Channel::Rotation(index - 3) };
                        if channels.contains(&channel) {
                            return Err(at("a channel is named twice."));
                        }
                        channels.push(channel);
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
    joints
        .into_iter()
        .map(|joint| {
            let offset = joint
                .offset
                .ok_or_else(|| format!("the joint \"{}\" has no OFFSET.", shorten(&joint.name)))?;
            let end_site = (!joint.has_children).then(|| joint.end_site.unwrap_or_default());
            let OpenJoint { name, parent, channels, .. } = joint;
            Ok(JointText { name, parent, offset, end_site, channels })
        })
        .collect()
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

/// Reads the MOTION section: the frame time in seconds, and the numbers of all whole frames.
fn read_motion(lines: &[&str], first_line: usize, channel_count: usize) -> Result<(f64, Vec<f32>), String> {
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
    let frame_time =
        decimal(frame_time).parse().ok().filter(|t| (1e-4..=2.0).contains(t)).ok_or_else(|| {
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
    let wanted = frame_count * channel_count;
    let mut values = Vec::with_capacity(wanted);
    for (index, line) in lines[rows_at..].iter().enumerate() {
        for token in line.split_whitespace().take(wanted - values.len()) {
            let value = number(token).filter(|v| v.abs() < 1e7).ok_or_else(|| {
                format!(
                    "line {}: \"{}\" is not a usable number.",
                    first_line + rows_at + index + 1,
                    shorten(token)
                )
            })?;
            values.push(value);
        }
    }
    Ok((frame_time, values))
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
        let plain = read(PLAIN.as_bytes()).unwrap();
        let [hips, head] = &plain.joints[..] else { panic!("{plain:?}") };
        assert_eq!((hips.name.as_str(), hips.parent, hips.offset), ("Hips", None, [0.0; 3]));
        assert_eq!((head.name.as_str(), head.parent, head.offset), ("Head", Some(0), [0.0, 10.0, 0.0]));
        assert_eq!((hips.end_site, head.end_site), (None, Some([0.0, 5.0, 0.0])));
        let turns = [Channel::Rotation(2), Channel::Rotation(0), Channel::Rotation(1)];
        assert_eq!(hips.channels[..3], [0, 1, 2].map(Channel::Position));
        assert_eq!((&hips.channels[3..], &head.channels[..]), (&turns[..], &turns[..]));
        assert_eq!((plain.frame_time, plain.channel_count), (0.0333333, 9));
        let row = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];
        assert_eq!(plain.values, [&row[..], &[8.0], &row[..], &[9.0]].concat());
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
        assert_eq!(read(&utf16).unwrap(), plain);
        for dialect in &mut dialects {
            assert_eq!(read(dialect.as_bytes()).unwrap(), plain, "{dialect}");
        }
        let named = PLAIN.replace("Head", "mixamorig:Left Up Leg");
        assert_eq!(read(named.as_bytes()).unwrap().joints[1].name, "mixamorig:Left Up Leg");
    }

    #[test]
    fn damage_gets_a_sentence() {
        let cases: [(String, &str); 17] = [
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
            (PLAIN.replace("7 9", "1e39 9"), "\"1e39\" is not a usable number"),
            (PLAIN.replace("OFFSET 0 10 0", "OFFSET 0 inf 0"), "three numbers"),
            (PLAIN.replace("7 9", "7 9 10 11"), "channels"),
            (PLAIN.replace("OFFSET 0 10 0", ""), "no OFFSET"),
            (
                PLAIN.replace("Zrotation Xrotation Yrotation\nEnd", "Zrotation Xrotation Wrotation\nEnd"),
                "Wrotation",
            ),
            (PLAIN.replace("0 1 2 3 4 5 6 7 8\n0 1 2 3 4 5 6 7 9\n", ""), "fewer than two"),
        ];
        for (text, part) in cases {
            let reason = read(text.as_bytes()).unwrap_err();
            assert!(reason.contains(part) && reason.ends_with('.'), "{reason} / {part}");
        }
        let nested =
            format!("HIERARCHY\nROOT a\n{{\nOFFSET 0 0 0\n{}", "JOINT a\n{\nOFFSET 0 0 0\n".repeat(5000));
        assert!(read(nested.as_bytes()).unwrap_err().contains("nested"));
        let wide = format!(
            "HIERARCHY\nROOT a\n{{\nOFFSET 0 0 0\n{}",
            "JOINT a\n{\nOFFSET 0 0 0\n}\n".repeat(100_000)
        );
        assert!(read(wide.as_bytes()).unwrap_err().contains("more than 1000 joints"));
    }

    /// A skeleton by each joint's parent, with its offsets, end sites and frames, in the crate's own form.
    fn peer(parents: &[usize], numbers: &[f32], frames: usize) -> bvh_anim::Bvh {
        use bvh_anim::ChannelType::*;
        let mut numbers = numbers.iter().copied().cycle();
        let mut three = || [(); 3].map(|()| numbers.next().unwrap_or_default()).into();
        let mut builder = bvh_anim::BvhLiteralBuilder::default();
        builder.push_root("J0");
        builder.push_joint_offset(three(), false);
        for channel in [PositionX, PositionY, PositionZ, RotationZ, RotationX, RotationY] {
            builder.push_channel(channel);
        }
        // Depth first, as the text has them: each joint below the last one or one of those around it.
        let mut depth = 0usize;
        for (index, up) in parents.iter().enumerate() {
            depth = if index == 0 { 1 } else { (depth + 1).saturating_sub(*up).max(1) };
            builder.current_depth = depth;
            builder.push_joint(&format!("J{}", index + 1));
            builder.push_joint_offset(three(), false);
            for channel in [RotationX, RotationY, RotationZ] {
                builder.push_channel(channel);
            }
            // A leaf, where the next joint is no deeper.
            if parents.get(index + 1).is_none_or(|up| *up > 0) {
                builder.push_joint_offset(three(), true);
            }
        }
        builder.set_frame_time(0.04);
        builder.set_num_frames(frames);
        let count = frames * builder.current_channel_index;
        builder.set_motion_values((0..count).map(|i| three().x + i as f32).collect());
        builder.bvh
    }

    proptest! {
        /// Beside the crate's own reader, on files that it wrote: every joint, and every number to the last bit.
        #[test]
        fn reads_like_its_peer(
            parents in proptest::collection::vec(0usize..5, 1..30),
            numbers in proptest::collection::vec(-1e4f32..1e4, 64),
            frames in 2usize..6,
            decimals in 0usize..12,
        ) {
            let text = bvh_anim::write::WriteOptions::new()
                .with_offset_significant_figures(decimals)
                .with_motion_values_significant_figures(decimals)
                .write_to_string(&peer(&parents, &numbers, frames));
            let theirs = bvh_anim::from_bytes(text.as_bytes()).unwrap();
            let ours = read(text.as_bytes()).unwrap();
            prop_assert_eq!(ours.joints.len(), theirs.joints().count());
            for (our, their) in ours.joints.iter().zip(theirs.joints()) {
                let data = their.data();
                prop_assert_eq!(our.name.as_bytes(), data.name().as_bytes());
                prop_assert_eq!(our.parent, their.parent().map(|p| p.data().index()));
                prop_assert_eq!(our.offset, <[f32; 3]>::from(*data.offset()));
                prop_assert_eq!(our.end_site, data.end_site().map(|e| <[f32; 3]>::from(*e)));
                prop_assert_eq!(our.channels.len(), data.num_channels());
            }
            prop_assert_eq!(ours.values, theirs.frames().flat_map(|f| f.as_slice().to_vec()).collect::<Vec<f32>>());
        }

        #[test]
        fn no_bytes_panic(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
            let _ = read(&bytes);
        }

        #[test]
        fn no_damage_panics(at in 0usize..300, cut in 0usize..300, put in "[ -~\n]{0,12}") {
            let (at, cut) = (at.min(PLAIN.len()), cut.min(PLAIN.len()));
            let (a, b) = (at.min(cut), at.max(cut));
            let _ = read(format!("{}{put}{}", &PLAIN[..a], &PLAIN[b..]).as_bytes());
        }
    }
}
