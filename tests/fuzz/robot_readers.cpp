// A robot card and its URDF, as two files.
#include <stdexcept>

#include "duet/robots/authoring/card_draft.h"
#include "duet/robots/card.h"
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

std::string urdf_sample(unsigned /*seed*/) { return test::kSmallUrdf; }

// The draft from any URDF is a card.
void draft_robot(std::string_view bytes) {
  const CardDraft draft = draft_card(std::string(bytes), "fuzz.urdf", "", "fuzz.urdf");
  try {
    static_cast<void>(parse_card(draft.text, "fuzz.yaml"));
  } catch (const InputError& error) {
    throw std::logic_error(error.what());
  }
}

}  // namespace

std::vector<Reader> robot_readers() {
  return {{"robot", robot_sample, read_robot}, {"robot_draft", urdf_sample, draft_robot}};
}

}  // namespace duet::fuzz
