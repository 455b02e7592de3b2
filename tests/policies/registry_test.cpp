// Policies that a program adds. Each test ends its own process: what is added stays.
#include "duet/policies/catalogue/registry.h"

#include <gmock/gmock.h>

#include <cstdlib>

#include "duet/core/require.h"
#include "tests/policies/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;
using ::testing::HasSubstr;

class Nod final : public Policy {
 public:
  explicit Nod(int loads) : loads_(loads) {}
  [[nodiscard]] std::string_view name() const override { return "nod"; }
  void reset(const EpisodeContext&) override {}
  Anchors act(const Observation&) override {
    Anchors anchors;
    for (Reference& anchor : anchors) anchor.q = Eigen::VectorXd::Constant(1, loads_);
    return anchors;
  }

 private:
  int loads_;
};

void add_nod(int& loads) {
  register_policy({.name = "nod", .about = "Nods", .options = {}},
                  [&loads](std::shared_ptr<const RobotModel>, const PolicyOptions&) -> PolicyMaker {
                    ++loads;
                    return [&loads] { return std::make_unique<Nod>(loads); };
                  });
}

void is_one_like_those_that_ship() {
  int loads = 0;
  add_nod(loads);
  EXPECT_EQ(policy_names().back(), "nod");
  EXPECT_EQ(policies().back().about, "Nods");
  EXPECT_TRUE(policy_files("nod").empty());
  const PolicyMaker maker = policy_maker("nod", test::g1());
  for (int i = 0; i < 3; ++i) EXPECT_EQ(maker()->act({})[0].q[0], 1.0);  // loaded once, made three times
  EXPECT_THAT(thrown_message<std::invalid_argument>([] { make_policy("nodd", test::g1()); }),
              HasSubstr("did you mean 'nod'?"));
  EXPECT_THAT(thrown_message<std::invalid_argument>([] {
                make_policy("nod", test::g1(), {{"often", "2"}});
              }),
              HasSubstr("policy 'nod'"));
  EXPECT_EQ(thrown_message<std::invalid_argument>([] { make_policy("nod", nullptr); }), "policy 'nod' needs a robot");
}

void takes_no_name_twice() {
  int loads = 0;
  add_nod(loads);
  EXPECT_EQ(thrown_message<std::invalid_argument>([&] { add_nod(loads); }),
            "policy 'nod' is there already: choose another name");
  EXPECT_EQ(thrown_message<std::invalid_argument>([] {
              register_policy({.name = "null", .about = {}, .options = {}}, [](auto&&...) { return PolicyMaker(); });
            }),
            "policy 'null' is there already: choose another name");
  EXPECT_THAT(thrown_message<std::invalid_argument>(
                  [] { register_policy({.name = "empty", .about = {}, .options = {}}, nullptr); }),
              HasSubstr("policy 'empty': expected a function that loads it, found none"));
}

template <typename Check>
[[noreturn]] void end_with(const Check& check) {
  check();
  std::exit(::testing::Test::HasFailure() ? 1 : 0);
}

TEST(AddedPolicy, IsOneLikeThoseThatShip) {
  EXPECT_EXIT(end_with(is_one_like_those_that_ship), ::testing::ExitedWithCode(0), "");
}
TEST(AddedPolicy, TakesNoNameThatIsThere) {
  EXPECT_EXIT(end_with(takes_no_name_twice), ::testing::ExitedWithCode(0), "");
}

}  // namespace
}  // namespace duet
