#include "berth/script/behaviour.hpp"

#include "berth/script/machine_parts.hpp"

namespace berth::script {

Behaviour::Behaviour(device::Device& device, rt::Executor& executor, Script script, Random random, Listener& listener,
                     const Limits& limits)
    : machine_(std::make_unique<Machine>(device, executor, std::move(script), random, listener, limits)) {}

Behaviour::~Behaviour() = default;

void Behaviour::stop() noexcept { machine_->stop(); }
bool Behaviour::running() const noexcept { return machine_->running(); }
std::size_t Behaviour::memory() const noexcept { return machine_->memory(); }

}  // namespace berth::script
