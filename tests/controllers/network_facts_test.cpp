#include <gmock/gmock.h>

#include "duet/controllers/catalogue/registry.h"
#include "duet/controllers/descriptor_controller.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/nn/catalogue/load_network.h"
#include "tests/support.h"

namespace duet {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

Descriptor descriptor() {
  Descriptor made;
  made.file = "d.yaml";
  made.name = "d";
  made.joints = {{.name = "left_hip_joint", .neutral = -0.1, .kp = 100.0, .kd = 2.0, .effort = {}, .action = 0.25},
                 {.name = "right_hip_joint", .neutral = -0.1, .kp = 100.0, .kd = 2.0, .effort = {}, .action = 0.25},
                 {.name = "waist_joint", .neutral = 0.0, .kp = 50.0, .kd = 1.0, .effort = {}, .action = 0.5}};
  return made;
}

std::vector<std::string> compared(const std::map<std::string, std::string>& metadata) {
  return compare_with_network(descriptor(), metadata, "net.onnx");
}

TEST(NetworkFacts, ThatAgreeAreNotSaidHoweverTheyAreSpelled) {
  for (const char* names :
       {"left_hip_joint,right_hip_joint,waist_joint", "[\"left_hip_joint\", \"right_hip_joint\", \"waist_joint\"]",
        "['Left_Hip', 'Right_Hip', 'Waist']", "left-hip-joint right-hip-joint waist-joint"})
    for (const char* key : {"joint_names", "dof_names", "JOINT_NAMES"})
      EXPECT_THAT(compared({{key, names},
                            {"joint_stiffness", "100.000,100,50.0"},
                            {"kd", "[2.0, 2, 1]"},
                            {"default_joint_pos", "-0.1004,-0.1,0.000"},
                            {"action_scale", "0.25,0.25,0.5"}}),
                  IsEmpty())
          << names;
  EXPECT_THAT(compared({}), IsEmpty());
  EXPECT_THAT(compared({{"run_path", "x"}, {"observation_names", "a,b"}}), IsEmpty());
  EXPECT_THAT(compared({{"joint_stiffness", "1,2"}}), IsEmpty());  // of nobody knows which
}

TEST(NetworkFacts, ThatDifferAreSaidWithBothNumbers) {
  EXPECT_THAT(compared({{"joint_stiffness", "100,102,51"}}),
              ElementsAre("d.yaml: controller 'd': 'joint_stiffness' of net.onnx is 102 for 'right_hip_joint', the "
                          "descriptor's 'kp' is 100, and 1 joints more differ"));
  EXPECT_SENTENCE(compared({{"dof_names", "left_hip_joint,right_hip_joint,waist_joint"},
                            {"kd", "[2, 2, 1.5]"},
                            {"default_joint_pos", "-0.1,-0.1,0.3"},
                            {"action_scale", "0.25"}}));
  EXPECT_THAT(compared({{"joint_names", "left_hip_joint,right_hip_joint,torso_joint"}, {"kp", "1,2,3"}}),
              ElementsAre(HasSubstr("'joint_names' of net.onnx names 3 joints, 'torso_joint' among them")));
}

TEST(NetworkFacts, JointsInAnotherOrderAreRefusedWithWhatElseDiffers) {
  const std::string message = test::thrown_message<InputError>([] {
    compared({{"joint_names", "right_hip_joint,left_hip_joint,waist_joint"},
              {"joint_stiffness", "100,101,50"},
              {"kp", "100,102,50"}});
  });
  EXPECT_SENTENCE(message);
  // Numbers are compared by the names that they are for.
  EXPECT_THAT(test::thrown_message<InputError>([] {
                compared({{"joint_names", "waist_joint,left_hip_joint,right_hip_joint"}, {"kp", "50,100,100"}});
              }),
              testing::Not(HasSubstr("'kp'")));
}

// The networks do not ship; where they are, the descriptors of this tree agree with what they say of themselves.
TEST(NetworkFacts, OfPublishedNetworksAreThoseOfOurDescriptors) {
  int found = 0;
  for (const char* name : {"beyond_mimic", "holosoma", "holosoma_fastsac", "holosoma_t1"}) {
    const Descriptor own = load_descriptor(name);
    const std::string path = [&] {
      try {
        return find_network(own);
      } catch (const MissingError&) {
        return std::string();
      }
    }();
    if (path.empty()) continue;
    ++found;
    EXPECT_THAT(compare_with_network(own, load_network_file(path).metadata, path), IsEmpty()) << name;
  }
  if (found == 0) GTEST_SKIP() << "not run: no published network that describes itself is here";
}

}  // namespace
}  // namespace duet
