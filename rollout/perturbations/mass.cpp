#include "duet/rollout/perturbations/mass.h"

#include "duet/core/require.h"

namespace duet {
namespace {

// A mass at the link's centre of mass; the controller keeps the nominal model.
struct Mass final : RobotPerturbation {
  std::string link;  // "": the card's push_link
  double add = 3.0;  // [kg]; below 0: taken away

  [[nodiscard]] std::shared_ptr<const RobotPerturbation> with_links(const RobotModel& robot) const override {
    auto bound = std::make_shared<Mass>(*this);
    bound->link = named_link(link, robot);
    return bound;
  }
  void check(const RobotModel& robot) const override {
    static_cast<void>(changed(std::make_shared<const RobotModel>(robot)));
  }
  [[nodiscard]] std::shared_ptr<const RobotModel> changed(std::shared_ptr<const RobotModel> robot) const override {
    auto heavier = std::make_shared<RobotModel>(*robot);
    RobotLink& loaded = heavier->links[perturbed_link(link, *robot)];
    require(loaded.mass + add > 0.0, "link '{}' has {:.3f} kg: expected some to be left, found {:g} kg added",
            loaded.name, loaded.mass, add);
    loaded.mass += add;
    return heavier;
  }
};

FieldTable<Mass> mass_table() {
  return {field<Mass>({.name = "link", .meaning = "a link; where there is none the card's push_link"}, &Mass::link),
          field<Mass>({.name = "add",
                       .meaning = "at the link's centre of mass; below 0 it is taken away",
                       .unit = "kg",
                       .range = {-100.0, 100.0}},
                      &Mass::add)};
}

}  // namespace

PerturbationKind mass_kind() {
  return robot_kind<Mass>("mass", "a link has more mass than the controller knows", mass_table());
}

}  // namespace duet
