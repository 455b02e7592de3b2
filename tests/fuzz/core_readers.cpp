// NPZ archives of any content, and recordings.
#include "duet/archives/npy/npz.h"
#include "duet/archives/recording_file.h"
#include "duet/core/file.h"
#include "tests/fuzz/archive_edit.h"
#include "tests/fuzz/reader.h"

namespace duet::fuzz {
namespace {

std::string npz_sample(unsigned /*seed*/) {
  Npz npz;
  npz.set("numbers", std::vector<double>{1.0, -2.5, 3.0, 4.0, 5.0, 6.0}, {2, 3});
  npz.set("integers", std::vector<std::int64_t>{1, 2, 3}, {3});
  npz.set("names", std::vector<std::string>{"left", "right"});
  npz.set_text("text", "hug");
  return npz.bytes();
}

void read_npz(std::string_view bytes) {
  const Npz npz = Npz::parse(bytes, "fuzz.npz");
  for (const std::string& key : npz.keys())
    if (npz.array(key).shape.size() == 2) (void)npz.numbers(key, {-1, 3});
}

// Two frames of a robot of three joints, one contact.
std::string good_recording() {
  Recording recording;
  recording.phases = {.act_begin = 0, .act_end = 2};
  for (int t = 0; t < 2; ++t) {
    RobotState state;
    state.q = state.v = Eigen::VectorXd::Constant(3, 0.1 * t);
    recording.robot.push_back(state);
    Reference reference;
    reference.q = state.q;
    recording.reference.push_back(reference);
    recording.q_target.push_back(state.q);
  }
  recording.partner = PointTracks(2, 24);
  recording.contacts = {{.frame = 1, .contact = {}}};
  const std::string path = scratch_folder() + "/good.npz";
  save_recording(recording, path);
  return read_file(path);
}

std::string recording_sample(unsigned seed) { return seed % 2 == 0 ? good_recording() : std::string(kEdit); }

void read_recording(std::string_view bytes) {
  static const Npz sample = Npz::parse(good_recording(), "sample");
  const Recording recording = load_recording(scratch_file("fuzz.npz", archive_of(sample, bytes)));
  save_recording(recording, scratch_folder() + "/again.npz");  // what was read can be written
}

}  // namespace

std::vector<Reader> core_readers() {
  return {{"npz", npz_sample, read_npz}, {"recording", recording_sample, read_recording}};
}

}  // namespace duet::fuzz
