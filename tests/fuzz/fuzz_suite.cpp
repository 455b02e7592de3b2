// Suite files.
#include "bench/suite.h"
#include "tests/fuzz/reader.h"

namespace {

const std::string kSample = R"(schema: duet.suite/1
name: sample
version: 1.0.0
seed: 7
clips: {synth: {per_task: 2, seed: 42}}
tasks: [hug, handshake]
engines: [playback]
controllers: [pd]
policies: [replay]
episodes_per_clip: 2
start: act
detector: {version: robot, thresholds: paper}
limits: {wall_s_per_episode: 60}
)";

}  // namespace

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size,
                                               unsigned seed) {
  return duet::fuzz::mutate(data, size, max_size, seed, kSample);
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return duet::fuzz::read_or_refuse([&] {
    const duet::Suite suite = duet::parse_suite(std::string(duet::fuzz::text_of(data, size)), "fuzz.yaml");
    (void)duet::parse_suite(duet::resolved_yaml(suite), "resolved.yaml");  // what was read can be written
  });
}
