#include "duet/formats/pickle_output.h"

#include <fmt/format.h>

#include <cstdlib>

#include "duet/archives/pickle/pickle_fields.h"
#include "duet/archives/pickle/pickle_machine.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/formats/robot_motion_format.h"
#include "tests/formats/known_motion.h"
#include "tests/support.h"

namespace duet {
namespace {

std::string sample() {
  PickleOutput out;
  out.begin_dict().key("fps").rate(30.0).key("slow").rate(29.97).key("big").rate(3e9);
  out.key("names").texts(std::vector<std::string>{"a", "Gruß"});
  out.key("x").array({2, 3}, std::vector<double>{1.0, -2.5, 3.0, 4.0, 1e300, -0.0});
  return out.end_dict().finish();
}

bool python_runs(const std::string& code) {
  return std::system(fmt::format("python3 -c '{}' > /dev/null 2>&1", code).c_str()) == 0;
}

bool python_runs_file(const test::ScratchFolder& folder, const std::string& script) {
  write_file(folder / "script.py", script);
  return std::system(fmt::format("python3 '{}' '{}'", folder / "script.py", folder / "a.pkl").c_str()) == 0;
}

TEST(PickleOutput, OurReaderReadsIt) {
  const std::string bytes = sample();
  const Pickle pickle = parse_pickle(bytes, "x.pkl");
  const PickleDict dict(pickle, pickle[pickle.root]);
  EXPECT_EQ(dict.get("fps").kind, PickleKind::kInt);
  EXPECT_EQ(pickle_rate(pickle, dict.get("fps")), 30.0);
  EXPECT_EQ(pickle_rate(pickle, dict.get("slow")), 29.97);
  EXPECT_EQ(pickle_rate(pickle, dict.get("big")), 3e9);
  EXPECT_EQ(dict.get("names").items.size(), 2U);
  EXPECT_EQ(pickle_table(pickle, dict.get("x"), "x", 2, {3}).values,
            (std::vector<double>{1.0, -2.5, 3.0, 4.0, 1e300, -0.0}));
}

TEST(PickleOutput, PythonsOwnToolsFindItWellFormed) {
  if (!python_runs("import pickletools")) GTEST_SKIP() << "not run: python3 absent";
  const test::ScratchFolder folder;
  write_file(folder / "a.pkl", sample());
  EXPECT_TRUE(python_runs_file(folder,
                               "import io, pickletools, sys\n"
                               "pickletools.dis(open(sys.argv[1], 'rb'), io.StringIO())\n"));
}

// Without NumPy: stand-ins for its three names show what the stream asks of them.
TEST(PickleOutput, PythonLoadsItWithNumPysNames) {
  if (!python_runs("import pickle")) GTEST_SKIP() << "not run: python3 absent";
  const test::ScratchFolder folder;
  write_file(folder / "a.pkl", sample());
  EXPECT_TRUE(python_runs_file(folder, R"(
import pickle, struct, sys
class ndarray:
    def __setstate__(self, state): self.version, self.shape, self.dtype, self.fortran, self.data = state
class dtype:
    def __init__(self, code, align, copy): self.made = (code, align, copy)
    def __setstate__(self, state): self.state = state
def _reconstruct(kind, shape, code):
    assert kind is ndarray and shape == (0,) and code == b'b'
    return ndarray()
class Loader(pickle.Unpickler):
    def find_class(self, module, name):
        return {('numpy.core.multiarray', '_reconstruct'): _reconstruct, ('numpy', 'ndarray'): ndarray,
                ('numpy', 'dtype'): dtype}[module, name]
made = Loader(open(sys.argv[1], 'rb')).load()
assert made['fps'] == 30 and isinstance(made['fps'], int) and made['slow'] == 29.97 and made['big'] == 3000000000
assert made['names'] == ['a', 'Gru\u00df']
x = made['x']
assert x.version == 1 and x.shape == (2, 3) and x.fortran is False
assert x.dtype.made == ('f8', False, True) and x.dtype.state == (3, '<', None, None, None, -1, -1, 0)
assert struct.unpack('<6d', x.data) == (1.0, -2.5, 3.0, 4.0, 1e300, -0.0)
)"));
}

TEST(PickleOutput, NumPyLoadsTheMotionsOfGmrAndPhc) {
  if (!python_runs("import numpy")) GTEST_SKIP() << "not run: python3 with numpy absent";
  const RobotModel robot = load_robot(card_path("g1"));
  const RobotMotion motion = test::known_motion(robot);
  const test::ScratchFolder folder;
  write_robot_motion(motion, robot, robot_motion_format("gmr"), folder / "a.pkl");
  EXPECT_TRUE(python_runs_file(folder, R"(
import pickle, sys, numpy as np
m = pickle.load(open(sys.argv[1], 'rb'))
assert m['fps'] == 50 and m['root_pos'].shape == (12, 3) and m['root_rot'].shape == (12, 4)
assert m['dof_pos'].shape == (12, 29) and m['dof_pos'].dtype == np.float64
assert m['local_body_pos'].shape == (12, 30, 3) and m['link_body_list'][0] == 'pelvis'
assert np.allclose(np.linalg.norm(m['root_rot'], axis=1), 1) and np.allclose(m['root_pos'][1, 0], 0.02)
)"));
  write_robot_motion(motion, robot, robot_motion_format("phc"), folder / "a.pkl", {.name = "walk"});
  EXPECT_TRUE(python_runs_file(folder, R"(
import pickle, sys, numpy as np
m = pickle.load(open(sys.argv[1], 'rb'))['walk']
assert m['fps'] == 50 and m['pose_aa'].shape == (12, 30, 3) and m['dof'].shape == (12, 29)
assert np.allclose(np.abs(m['pose_aa'][:, 1:]).sum(-1), np.abs(m['dof'])) and m['root_rot'].shape == (12, 4)
)"));
}

TEST(PickleOutput, AnArrayThatDoesNotFitItsShapeIsRefused) {
  PickleOutput out;
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { out.array({2, 2}, std::vector<double>{1.0}); }));
}

}  // namespace
}  // namespace duet
