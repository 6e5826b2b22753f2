#include "berth/places/recipe_binder.hpp"

#include "berth/places/identity.hpp"

namespace berth::places {

rt::Task<void> RecipeBinder::run(RecipeBinding& binding, SlotId slot, const std::string& reason) {
  while (!binding.ended()) {
    const Outcome outcome = co_await perform(binding, slot, reason);
    binding.advance(outcome);
  }
}

rt::Task<Outcome> RecipeBinder::perform(const RecipeBinding& binding, SlotId slot, const std::string& reason) {
  const Assignment seat = binding.assignment();
  const NodeId old_id = binding.old_id();
  switch (binding.step()) {
    case RecipeStep::check_vacant: {
      Binder binder(s_, options_);
      co_return co_await binder.vacant(seat.id, seat.device);
    }
    case RecipeStep::identify_old: {
      identified_ = s_.dispatcher.executor().now();
      co_return co_await identify(old_id, seat.device);
    }
    case RecipeStep::write_ask: co_return outcome_of(s_.store.ask(slot, seat, reason), store_said_);
    case RecipeStep::write: co_return co_await write(old_id, seat.id);
    case RecipeStep::revert: co_return co_await write(old_id, old_id);
    case RecipeStep::reset: co_return co_await reset(binding);
    case RecipeStep::await_boot_up: {
      const rt::Time deadline = s_.dispatcher.executor().now() + options_.boot_timeout;
      const bool heard = co_await s_.boots.wait(seat.id, moved_, deadline);
      co_return heard ? Outcome::ok : Outcome::silent;
    }
    case RecipeStep::identify: {
      const Outcome who = co_await identify(seat.id, seat.device);
      if (who == Outcome::ok) s_.vacancy[seat.id.value() & 0x7FU].reset();
      co_return who;
    }
    case RecipeStep::write_confirm: co_return outcome_of(s_.store.confirm(slot, seat, reason), store_said_);
    case RecipeStep::done:
    case RecipeStep::power_cycle:
    case RecipeStep::failed: break;
  }
  co_return Outcome::error;
}

rt::Task<Outcome> RecipeBinder::identify(NodeId id, const Identity& device) {
  const auto answer = co_await places::identify(s_.sdo, id);
  if (answer.by_two) co_return Outcome::several;
  const auto& who = answer.who;
  if (!who) co_return who.error().code == Errc::timeout ? Outcome::silent : outcome_of(who.error());
  co_return who->agrees(device) ? Outcome::ok : Outcome::mismatch;
}

std::vector<std::uint8_t> RecipeBinder::bytes(const Recipe::Write& write, NodeId id) {
  const std::uint64_t value = write.node_id ? id.value() : write.value;
  std::vector<std::uint8_t> out;
  for (unsigned i = 0; i < write.size; ++i) out.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
  return out;
}

// `unsupported`: the first object was refused, so nothing in the device has changed.
rt::Task<Outcome> RecipeBinder::write(NodeId at, NodeId id) {
  bool first = true;
  for (const auto& object : recipe_->writes) {
    const std::vector<std::uint8_t> value = bytes(object, id);
    const std::span<const std::uint8_t> data(value);
    const std::uint16_t index = object.index;
    const std::uint8_t sub = object.sub;
    const auto written = co_await s_.sdo.download(at, index, sub, data);
    if (!written && first && written.error().code == Errc::aborted) co_return Outcome::unsupported;
    if (!written) co_return outcome_of(written.error());
    first = false;
  }
  co_return Outcome::ok;
}

// A boot-up under either node-ID meanwhile comes from a second device; the first must not join it there.
rt::Task<Outcome> RecipeBinder::reset(const RecipeBinding& binding) {
  if (s_.boots.booted_since(binding.old_id(), identified_)) co_return Outcome::several;
  if (s_.boots.booted_since(binding.assignment().id, identified_)) co_return Outcome::mismatch;
  moved_ = s_.dispatcher.executor().now();
  const bool node = recipe_->after == Recipe::After::reset_node;
  const auto command = node ? co::NmtCommand::reset_node : co::NmtCommand::reset_communication;
  const NodeId old_id = binding.old_id();
  const auto sent = co_await s_.nmt.send(command, old_id);
  co_return sent ? Outcome::ok : Outcome::error;
}

}  // namespace berth::places
