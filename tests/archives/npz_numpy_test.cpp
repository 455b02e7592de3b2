// Both directions against NumPy itself, where python3 has it.
#include <fmt/format.h>

#include <cstdlib>
#include <limits>

#include "duet/archives/npy/npz.h"
#include "duet/core/file.h"
#include "tests/support.h"

namespace duet {
namespace {

// The first interpreter that has NumPy, "" without one.
std::string python() {
  for (const std::string interpreter : {"python3", "/usr/bin/python3"})
    if (std::system(fmt::format("{} -c 'import numpy' > /dev/null 2>&1", interpreter).c_str()) == 0) return interpreter;
  return "";
}

bool run_python(const std::string& interpreter, const test::ScratchFolder& folder, const std::string& script) {
  write_file(folder / "script.py", "import numpy as np\nimport sys\n" + script);
  return std::system(fmt::format("{} '{}' '{}'", interpreter, folder / "script.py", folder / "a.npz").c_str()) == 0;
}

TEST(NpzAndNumpy, NumpyOpensWhatIsWritten) {
  const std::string interpreter = python();
  if (interpreter.empty()) GTEST_SKIP() << "not run: python3 with numpy absent";
  const test::ScratchFolder folder;
  Npz npz;
  npz.set("x", std::vector<double>{0.1, 1e300, -0.0, std::numeric_limits<double>::quiet_NaN(), 4, 5}, {2, 3});
  npz.set("n", std::vector<std::int64_t>{-(1LL << 62), 7}, {2});
  npz.set("names", std::vector<std::string>{"left", "", "Gruß 你好 🙂"});
  npz.set("empty", std::vector<double>{}, {0, 3});
  npz.set_text("task", "fly_kiss");
  npz.set_number("rate_hz", 50.0);
  npz.save(folder / "a.npz");
  EXPECT_TRUE(run_python(interpreter, folder, R"(
z = np.load(sys.argv[1], allow_pickle=False)
assert sorted(z.files) == ['empty', 'n', 'names', 'rate_hz', 'task', 'x'], z.files
assert z['x'].shape == (2, 3) and z['x'].dtype == np.dtype('<f8')
assert z['x'][0, 0] == 0.1 and z['x'][0, 1] == 1e300 and np.signbit(z['x'][0, 2]) and np.isnan(z['x'][1, 0])
assert z['n'].tolist() == [-(2**62), 7] and z['n'].dtype == np.dtype('<i8')
assert z['names'].tolist() == ['left', '', 'Gruß 你好 🙂']
assert z['empty'].shape == (0, 3)
assert str(z['task']) == 'fly_kiss' and z['task'].shape == ()
assert float(z['rate_hz']) == 50.0
)"));
}

TEST(NpzAndNumpy, WhatNumpyWritesIsRead) {
  const std::string interpreter = python();
  if (interpreter.empty()) GTEST_SKIP() << "not run: python3 with numpy absent";
  for (const char* save : {"savez", "savez_compressed"}) {
    const test::ScratchFolder folder;
    ASSERT_TRUE(run_python(interpreter, folder, R"(
a = np.arange(24.0).reshape(2, 3, 4)
np.)" + std::string(save) + R"((sys.argv[1], c=a, fortran=np.asfortranarray(a), big=a.astype('>f4'), half=a[:, ::2],
  ints=np.array([[-5, 6]], dtype='>i2'), flags=np.array([True, False]), unsigned=np.array(2**63 - 1, dtype='u8'),
  text=np.array('höher'), names=np.array([['a', 'bcd']]), raw=np.array([b'xy', b'z']), scalar=30, real=29.97,
  none=np.zeros((0, 5))))"));
    const Npz npz = Npz::load(folder / "a.npz");
    std::vector<double> counted(24);
    for (int i = 0; i < 24; ++i) counted[static_cast<std::size_t>(i)] = i;
    for (const char* key : {"c", "fortran", "big"}) EXPECT_EQ(npz.numbers(key, {2, 3, 4}), counted) << key;
    EXPECT_EQ(npz.array("half").shape, (std::vector<std::size_t>{2, 2, 4}));
    EXPECT_EQ(npz.integers("ints", {1, 2}), (std::vector<std::int64_t>{-5, 6}));
    EXPECT_EQ(npz.integers("flags", {2}), (std::vector<std::int64_t>{1, 0}));
    EXPECT_EQ(npz.integer("unsigned"), std::numeric_limits<std::int64_t>::max());
    EXPECT_EQ(npz.text("text"), "höher");
    EXPECT_EQ(npz.strings("names", {1, 2}), (std::vector<std::string>{"a", "bcd"}));
    EXPECT_EQ(npz.strings("raw", {2}), (std::vector<std::string>{"xy", "z"}));
    EXPECT_EQ(npz.number("scalar"), 30.0);
    EXPECT_EQ(npz.number("real"), 29.97);
    EXPECT_TRUE(npz.numbers("none", {0, 5}).empty());
  }
}

TEST(NpzAndNumpy, AnObjectArrayIsRefusedAndNotExecuted) {
  const std::string interpreter = python();
  if (interpreter.empty()) GTEST_SKIP() << "not run: python3 with numpy absent";
  const test::ScratchFolder folder;
  ASSERT_TRUE(run_python(interpreter, folder, "np.savez(sys.argv[1], a=np.array([None, {}], dtype=object))\n"));
  EXPECT_EQ(test::thrown_message<std::runtime_error>([&] { Npz::load(folder / "a.npz"); }),
            fmt::format("'{}': array 'a': object arrays ('|O') hold Python code and are not read", folder / "a.npz"));
}

}  // namespace
}  // namespace duet
