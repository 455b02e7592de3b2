// A robot card and its URDF, as two files.
#include "duet/robots/robot_model.h"
#include "tests/fuzz/reader.h"
#include "tests/robots/fixtures.h"

namespace duet::fuzz {
namespace {

std::string robot_sample(unsigned /*seed*/) { return test::kSmallCard + std::string(kSeparator) + test::kSmallUrdf; }

void read_robot(std::string_view bytes) {
  const std::vector<std::string_view> files = parts(bytes, 2);
  (void)load_robot(scratch_file("card.yaml", files[0]), scratch_file("small.urdf", files[1]));
}

}  // namespace

std::vector<Reader> robot_readers() { return {{"robot", robot_sample, read_robot}}; }

}  // namespace duet::fuzz
