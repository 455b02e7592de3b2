// Files that trainings leave behind: checkpoints of WBC-Sim, demonstrations, lists of held-out clips.
#include "duet/core/file.h"
#include "duet/training/agent.h"
#include "duet/training/dstar/demonstrations.h"
#include "tests/fuzz/reader.h"
#include "tests/fuzz/tensor_edit.h"

namespace duet::fuzz {
namespace {

const SafeTensors& good_checkpoint() {
  static const SafeTensors content = [] {
    TrainingState state;
    state.agent = make_agent(3, 4, 2, 0.5, 7);
    state.stage = "oracle";
    state.robot_digest = "digest";
    return to_tensors(state);
  }();
  return content;
}

std::string checkpoint_sample(unsigned seed) { return tensors_sample(good_checkpoint(), seed); }

void read_checkpoint(std::string_view bytes) {
  (void)training_state(parse_safetensors(tensors_of(good_checkpoint(), bytes), "fuzz"), "fuzz");
}

const SafeTensors& good_demonstrations() {
  static const SafeTensors content = [] {
    DemonstrationSet set;
    set.robot_digest = "digest";
    set.origin = "fuzz";
    set.observed.resize(13 + 2 * 2, 0);  // of a robot of two joints
    set.wanted.resize(7 + 2, 0);
    set.partner.resize(72, 0);
    const std::string path = scratch_folder() + "/demonstrations.safetensors";
    save_demonstrations(set, path);
    SafeTensors file = read_safetensors(path);
    file.metadata["demonstrations"] =
        R"([{"clip":"x","digest":"d","task":"hug","act":[1,2],"leads":false,"frames":3}])";
    for (auto& [name, tensor] : file.tensors) {
      tensor.shape[0] = 3;
      tensor.values.resize(static_cast<std::size_t>(3 * tensor.shape[1]));
    }
    return file;
  }();
  return content;
}

std::string demonstrations_sample(unsigned seed) { return tensors_sample(good_demonstrations(), seed); }

void read_demonstrations(std::string_view bytes) {
  (void)load_demonstrations(scratch_file("fuzz.safetensors", tensors_of(good_demonstrations(), bytes)), "digest",
                            "fuzz");
}

std::string split_sample(unsigned /*seed*/) { return "# held out\n" + std::string(64, 'a') + " clips/hug.npz\n"; }

void read_split(std::string_view bytes) { (void)load_split(scratch_file("split.txt", bytes)); }

}  // namespace

std::vector<Reader> training_readers() {
  return {{"wbc_checkpoint", checkpoint_sample, read_checkpoint},
          {"demonstrations", demonstrations_sample, read_demonstrations},
          {"split", split_sample, read_split}};
}

}  // namespace duet::fuzz
