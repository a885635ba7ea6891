//! Clips written as the `.bvh` files that other programs write.

use glam::{EulerRot, Mat3, Quat, Vec3};
use oncue::internals::UpAxis;
use oncue::library::Clip;
use oncue::motion::skeleton::{JOINT_COUNT, JOINT_OFFSET, NAMES, PARENT};
use rand::{RngExt, SeedableRng};

/// How a clip is written: a taller person at 60 Hz, each joint with a frame of its own.
pub struct Written {
    /// Of the joints' frames.
    pub seed: u64,
    pub units_in_a_metre: f32,
    pub up: UpAxis,
    /// What a joint of ours is called.
    pub name: fn(&str) -> String,
    /// Frames a second by the file's header; it has 60.
    pub header_rate: f64,
    /// The way over the floor is taken away.
    pub on_the_spot: bool,
    /// The way over the floor is so many times as long as the steps.
    pub way_times: f32,
    /// X is flipped, as in left-handed coordinates.
    pub left_handed: bool,
}

impl Default for Written {
    fn default() -> Self {
        Self {
            seed: 7,
            units_in_a_metre: 100.0,
            up: UpAxis::Y,
            name: str::to_owned,
            header_rate: 60.0,
            on_the_spot: false,
            way_times: 1.0,
            left_handed: false,
        }
    }
}

impl Written {
    /// The file's text.
    pub fn text(&self, clip: &Clip) -> String {
        let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(self.seed);
        let mut turn = || {
            Quat::from_scaled_axis(Vec3::from_array(std::array::from_fn(|_| random.random_range(-1.8..1.8))))
        };
        let frames: Vec<Quat> = (0..JOINT_COUNT).map(|_| turn()).collect();
        let turned = Quat::from_rotation_arc(Vec3::Z, self.up.direction());
        let size = 1.12 * self.units_in_a_metre;
        let place = |p: Vec3| if self.left_handed { Vec3::new(-p.x, p.y, p.z) } else { p } * size;
        let rotation = |q: Quat| {
            let flip = Mat3::from_diagonal(Vec3::new(-1.0, 1.0, 1.0));
            if self.left_handed { Quat::from_mat3(&(flip * Mat3::from_quat(q) * flip)) } else { q }
        };
        let mut text = String::from("HIERARCHY\n");
        let mut depths = [0; JOINT_COUNT];
        let mut open = 0;
        for j in 0..JOINT_COUNT {
            depths[j] = if j == 0 { 0 } else { depths[PARENT[j]] + 1 };
            for _ in depths[j]..open {
                text.push_str("}\n");
            }
            open = depths[j] + 1;
            let offset =
                if j == 0 { Vec3::ZERO } else { place(frames[PARENT[j]].inverse() * JOINT_OFFSET[j]) };
            let (keyword, positions) =
                if j == 0 { ("ROOT", "6 Xposition Yposition Zposition") } else { ("JOINT", "3") };
            text.push_str(&format!(
                "{keyword} {}\n{{\nOFFSET {} {} {}\nCHANNELS {positions} Zrotation Xrotation Yrotation\n",
                (self.name)(NAMES[j]),
                offset.x,
                offset.y,
                offset.z
            ));
        }
        text.push_str(&"}\n".repeat(open));
        let mut rows = Vec::new();
        let count = clip.motion.len();
        for step in 0..2 * count - 1 {
            let (a, b) = (step / 2, step.div_ceil(2));
            let (pa, pb) = (&clip.motion.postures[a], &clip.motion.postures[b]);
            let mut posture = *pa;
            posture.root_position = pa.root_position.lerp(pb.root_position, 0.5);
            let times = if self.on_the_spot { 0.0 } else { self.way_times };
            posture.root_position.x *= times;
            posture.root_position.y *= times;
            for j in 0..JOINT_COUNT {
                posture.rotations[j] = pa.rotations[j].slerp(pb.rotations[j], 0.5);
            }
            let pose = posture.pose();
            let global = |j: usize| turned * pose.rotations[j] * frames[j];
            let root = place(turned * pose.positions[0]);
            let mut row = vec![root.x, root.y, root.z];
            for j in 0..JOINT_COUNT {
                let local = if j == 0 { global(0) } else { global(PARENT[j]).inverse() * global(j) };
                let (z, x, y) = rotation(local).to_euler(EulerRot::ZXY);
                row.extend([z.to_degrees(), x.to_degrees(), y.to_degrees()]);
            }
            rows.push(row.iter().map(|v| format!("{v:.5}")).collect::<Vec<_>>().join(" "));
        }
        let seconds = 1.0 / self.header_rate;
        format!("{text}MOTION\nFrames: {}\nFrame Time: {seconds:.7}\n{}\n", rows.len(), rows.join("\n"))
    }
}
