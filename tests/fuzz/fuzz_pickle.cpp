// Pickled robot motions.
#include "motion/pickle.h"
#include "tests/fuzz/reader.h"
#include "tests/motion/pickle_bytes.h"

namespace {

const std::string& sample() {
  static const std::string bytes = [] {
    duet::test::PickleWriter out(4);
    out.raw("}(").text("fps").real(30.0);
    out.text("root_pos").doubles({2, 3}, {0, 0, 0.8, 0.1, 0, 0.8});
    out.text("root_rot").doubles({2, 4}, {0, 0, 0, 1, 0, 0, 0.6, 0.8});
    out.text("dof_pos").doubles({2, 2}, {0.1, 0.2, 0.3, 0.4});
    out.text("local_body_pos").none();
    out.text("link_body_list").raw("](").text("pelvis").raw("eu.");
    return out.str();
  }();
  return bytes;
}

}  // namespace

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size,
                                               unsigned seed) {
  return duet::fuzz::mutate(data, size, max_size, seed, sample());
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return duet::fuzz::read_or_refuse(
      [&] { (void)duet::parse_motion_pickle(duet::fuzz::text_of(data, size), "fuzz.pkl"); });
}
