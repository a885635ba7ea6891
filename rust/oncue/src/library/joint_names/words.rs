//! The words of a joint's name, without what it shares with all the others.

/// The words of each joint's name, lower-case, without name-spaces, digits and what most of the names begin or end
/// with (`Model_`, `_jnt`), sides apart.
pub(super) fn of_joints(names: &[&str]) -> Vec<Vec<String>> {
    let plain: Vec<&str> =
        names.iter().map(|name| name.rsplit([':', '|', '/']).next().unwrap_or(name)).collect();
    let mut all: Vec<Vec<String>> = without_common_letters(&plain).into_iter().map(split).collect();
    drop_shared(&mut all, |words| words.first(), |words| drop(words.remove(0)));
    drop_shared(&mut all, |words| words.last(), |words| drop(words.pop()));
    all
}

/// Names fewer than these have no prefix in common, only letters.
const FEWEST_NAMES: usize = 8;

/// The names without the letters with which all of them begin and end, where these are three at least: exporters
/// also write prefixes without a separator.
fn without_common_letters<'a>(names: &[&'a str]) -> Vec<&'a str> {
    let shared = |backwards: bool| {
        let letters = |name: &'a str| -> Box<dyn Iterator<Item = char> + 'a> {
            if backwards { Box::new(name.chars().rev()) } else { Box::new(name.chars()) }
        };
        let Some(first) = names.first() else { return 0 };
        let count = |name: &'a str| letters(first).zip(letters(name)).take_while(|(a, b)| a == b).count();
        names.iter().map(|name| count(name)).min().unwrap_or(0)
    };
    let (head, tail) = (shared(false), shared(true));
    let enough = |count: usize| if names.len() >= FEWEST_NAMES && count >= 3 { count } else { 0 };
    let (head, tail) = (enough(head), enough(tail));
    let cut = |name: &'a str| {
        let count = name.chars().count();
        if count <= head + tail {
            return name;
        }
        let at = |n: usize| name.char_indices().nth(n).map_or(name.len(), |(i, _)| i);
        &name[at(head)..at(count - tail)]
    };
    names.iter().map(|name| cut(name)).collect()
}

/// Drops, again and again, the word at one end that half of the names have there. A name keeps at least one word that
/// is no side.
fn drop_shared(
    all: &mut [Vec<String>],
    end: impl Fn(&Vec<String>) -> Option<&String>,
    cut: impl Fn(&mut Vec<String>),
) {
    for _ in 0..4 {
        let mut counts = std::collections::BTreeMap::<&str, usize>::new();
        for word in all.iter().filter_map(&end).filter(|word| side(word).is_none()) {
            *counts.entry(word).or_default() += 1;
        }
        let Some((word, count)) = counts.into_iter().max_by_key(|&(_, count)| count) else { return };
        if count * 2 < all.len() || all.len() < FEWEST_NAMES {
            return;
        }
        let word = word.to_owned();
        for words in all.iter_mut().filter(|words| end(words) == Some(&word)) {
            let mut rest = words.clone();
            cut(&mut rest);
            if rest.iter().any(|word| side(word).is_none()) {
                *words = rest;
            }
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Side {
    Left,
    Right,
    Middle,
}

/// The side that a word stands for.
pub(super) fn side(word: &str) -> Option<Side> {
    Some(match word {
        "left" | "l" | "lft" | "lf" => Side::Left,
        "right" | "r" | "rgt" | "rt" => Side::Right,
        "c" | "center" | "centre" => Side::Middle,
        _ => return None,
    })
}

/// "LeftUpLeg" → left up leg, "LHipJoint" → l hip joint, "LFArm" → l f arm.
fn split(name: &str) -> Vec<String> {
    let mut words: Vec<String> = vec![String::new()];
    let mut last_lower = false;
    let chars: Vec<char> = name.chars().collect();
    for (i, &c) in chars.iter().enumerate() {
        let next_lower = chars.get(i + 1).is_some_and(|n| n.is_lowercase());
        let last_upper = i > 0 && chars[i - 1].is_uppercase();
        if !c.is_alphabetic() {
            words.push(String::new());
        } else {
            if c.is_uppercase() && (last_lower || (last_upper && next_lower)) {
                if let Some(letters) =
                    words.last_mut().filter(|w| matches!(w.as_str(), "lf" | "lu" | "rf" | "ru"))
                {
                    let letter = letters.split_off(1);
                    words.push(letter);
                }
                words.push(String::new());
            }
            if let Some(word) = words.last_mut() {
                word.extend(c.to_lowercase());
            }
        }
        last_lower = c.is_lowercase();
    }
    words.retain(|w| !w.is_empty());
    words
}
