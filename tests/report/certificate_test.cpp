#include <gmock/gmock.h>

#include "duet/report/engines/cross_engine.h"
#include "tests/support.h"

namespace duet {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

nlohmann::json certificate() {
  return nlohmann::json::parse(R"({"schema": "duet.certificate/1", "effort": "full",
    "created_at": "2026-01-02T03:04:05Z", "digest": "0123456789abcdef", "engines": [
      {"name": "mujoco", "version": "2.2.2", "profile": "parity", "passed": 20, "failed": 0, "deviations": 1},
      {"name": "ode", "version": "0.16.2", "profile": "parity", "passed": ["a", "b"], "failed": [], "deviations": {}}
    ]})");
}

std::string certificate_text(const nlohmann::json& certificate, const std::vector<RunEngine>& engines = {}) {
  return markdown_of(certificate_table(certificate, engines));
}

TEST(Certificate, IsATableOfEngines) {
  const std::string text = certificate_text(certificate());
  EXPECT_SENTENCE(text);
}

TEST(Certificate, WithoutOneSaysHowToMakeOne) {
  EXPECT_EQ(certificate_text(nullptr),
            "### Parity certificate\n\nNo parity certificate is attached (duet validate makes one).\n");
}

TEST(Certificate, IsReadTolerantly) {
  EXPECT_THAT(certificate_text({{"schema", "duet.certificate/9"}, {"engines", {{{"name", "dart"}, {"x", 1}}, 3}}}),
              AllOf(HasSubstr("| dart   | -       | -       |             - |                   - |      - |"),
                    HasSubstr("Effort -, made -"), HasSubstr("Its schema is duet.certificate/9, expected")));
  EXPECT_SENTENCE(certificate_text({{"engines", "none"}}));
  EXPECT_SENTENCE(certificate_text("yes"));
  EXPECT_THAT(certificate_text({{"effort", "a\xff"}}), HasSubstr("digest"));
  EXPECT_THAT(certificate_text({{"effort", "<img src=x>\x1b[0m\n# no"}}),
              HasSubstr("Effort &lt;img src=x>\\x1b[0m # no, made"));
}

TEST(Certificate, NamesEnginesThatItDoesNotCoverAsTheyWereRun) {
  const std::string text = certificate_text(
      certificate(), {{"mujoco", "2.2.2", "parity"}, {"ode", "0.16.2", "fast"}, {"dart", "6.12", "parity"}});
  EXPECT_SENTENCE(text);
  EXPECT_THAT(certificate_text(certificate(), {{"ode", "", ""}}), Not(HasSubstr("These results")));
}

}  // namespace
}  // namespace duet
