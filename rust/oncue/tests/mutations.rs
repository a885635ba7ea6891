//! A thousand changed files of each kind: none takes the process along, none hangs, and none is read as nonsense.

#[path = "common/mutate.rs"]
mod mutate;

#[test]
fn no_changed_file_does_harm() {
    for kind in mutate::kinds() {
        assert_eq!(kind.read_whole(), Ok(true), "{}", kind.name);
        let counts = mutate::try_kind(&kind, 1000, 1);
        println!("{}: {counts:?}", kind.name);
        assert_eq!(counts.panics, Vec::<String>::new(), "{}", kind.name);
        assert_eq!(counts.nonsense, Vec::<String>::new(), "{}", kind.name);
        assert_eq!((counts.hangs, counts.read + counts.refused), (0, counts.inputs), "{}", kind.name);
        // The changes are such that some are noticed and some are not.
        assert!(counts.refused > 100 && counts.read > 30, "{}: {counts:?}", kind.name);
    }
}
