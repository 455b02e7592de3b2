#include "duet/training/agent.h"

#include <fmt/format.h>

#include <cmath>

#include "duet/training/checkpoint.h"

namespace duet {
namespace {

constexpr const char* kCheckpointFormat = "duet.wbc-checkpoint/1";

std::vector<Eigen::Map<Eigen::VectorXf>> parameters_of(WbcAgent& agent) {
  auto parameters = flat_views(agent.actor.layers);
  const auto critic = flat_views(agent.critic.layers);
  parameters.insert(parameters.end(), critic.begin(), critic.end());
  parameters.emplace_back(agent.log_std.data(), agent.log_std.size());
  return parameters;
}

}  // namespace

WbcAgent make_agent(int actor_inputs, int critic_inputs, int actions, double std, std::uint64_t seed) {
  Random random(seed, stream_key({"wbc weights"}));
  WbcAgent agent;
  agent.actor = random_mlp({actor_inputs, 512, 256, 128, actions}, 0.05F, random);
  agent.critic = random_mlp({critic_inputs, 512, 256, 128, 1}, 1.0F, random);
  agent.log_std = Eigen::VectorXf::Constant(actions, static_cast<float>(std::log(std)));
  agent.actor_input = Normaliser(actor_inputs);
  agent.critic_input = Normaliser(critic_inputs);
  return agent;
}

SafeTensors to_tensors(const TrainingState& state) {
  SafeTensors tensors;
  add_mlp(tensors, "actor", state.agent.actor);
  add_mlp(tensors, "critic", state.agent.critic);
  tensors.tensors["log_std"] = tensor_of(state.agent.log_std);
  add_normaliser(tensors, "actor_input", state.agent.actor_input);
  add_normaliser(tensors, "critic_input", state.agent.critic_input);
  add_adam(tensors, state.adam);
  tensors.metadata["format"] = kCheckpointFormat;
  tensors.metadata["rate"] = fmt::format("{}", state.rate);
  tensors.metadata["iteration"] = std::to_string(state.iteration);
  tensors.metadata["steps"] = std::to_string(state.steps);
  if (state.critic_alone > 0) tensors.metadata["critic_alone"] = std::to_string(state.critic_alone);
  tensors.metadata["minutes"] = fmt::format("{}", state.minutes);
  tensors.metadata["stage"] = state.stage;
  tensors.metadata["robot_digest"] = state.robot_digest;
  tensors.metadata["seed"] = std::to_string(state.seed);
  return tensors;
}

TrainingState training_state(const SafeTensors& tensors, const std::string& file) {
  expect_text(tensors, "format", kCheckpointFormat, file);
  TrainingState state;
  state.agent.actor = read_mlp(tensors, "actor", file);
  state.agent.critic = read_mlp(tensors, "critic", file);
  state.agent.log_std = vector_of(tensors, "log_std", state.agent.actor.outputs(), file);
  state.agent.actor_input = normaliser_of(tensors, "actor_input", state.agent.actor.inputs(), file);
  state.agent.critic_input = normaliser_of(tensors, "critic_input", state.agent.critic.inputs(), file);
  state.adam = adam_of(tensors, parameters_of(state.agent), file);
  state.rate = number_of(tensors, "rate", file);
  state.iteration = std::lround(number_of(tensors, "iteration", file));
  state.steps = std::lround(number_of(tensors, "steps", file));
  if (tensors.metadata.contains("critic_alone"))
    state.critic_alone = std::lround(number_of(tensors, "critic_alone", file));
  state.minutes = number_of(tensors, "minutes", file);
  state.stage = text_of(tensors, "stage", file);
  state.robot_digest = text_of(tensors, "robot_digest", file);
  state.seed = static_cast<std::uint64_t>(number_of(tensors, "seed", file));
  return state;
}

}  // namespace duet
