#include "controllers/controller.h"

#include "controllers/pd.h"
#include "controllers/vmc.h"
#include "core/names.h"
#include "core/require.h"

namespace duet {
namespace {

std::unique_ptr<Controller> make_default_vmc(std::shared_ptr<const RobotModel> robot) {
  return make_vmc_controller(std::move(robot));
}

struct Entry {
  const char* name;
  std::unique_ptr<Controller> (*make)(std::shared_ptr<const RobotModel>);
};

constexpr Entry kControllers[] = {{"pd", make_pd_controller}, {"vmc", make_default_vmc}};

}  // namespace

std::vector<std::string> controller_names() {
  std::vector<std::string> names;
  for (const Entry& entry : kControllers) names.emplace_back(entry.name);
  return names;
}

std::unique_ptr<Controller> make_controller(const std::string& name, std::shared_ptr<const RobotModel> robot) {
  require(robot != nullptr, "make_controller: no robot");
  for (const Entry& entry : kControllers)
    if (name == entry.name) return entry.make(std::move(robot));
  throw std::invalid_argument(unknown_name_message("controller", name, controller_names()));
}

}  // namespace duet
