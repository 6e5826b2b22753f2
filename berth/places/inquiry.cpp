#include "berth/places/inquiry.hpp"

#include <algorithm>

#include "berth/co/guarding.hpp"
#include "berth/places/identity.hpp"
#include "berth/rt/scope.hpp"

namespace berth::places {
namespace {
constexpr rt::Duration asked_for = std::chrono::milliseconds(100);
}  // namespace

rt::Task<bool> Inquiry::answers_at(NodeId id, co::SdoOptions how, rt::Duration guard_timeout) {
  const rt::Time began = s_.dispatcher.executor().now();
  const auto type = co_await s_.sdo.read<std::uint32_t>(id, 0x1000, 0, how);
  if (type || type.error().code == Errc::aborted) co_return true;
  if (type.error().code != Errc::timeout) co_return false;
  const auto guarded = co_await co::guard_once(s_.dispatcher, id, guard_timeout, 1);
  // A port without remote frames (socketcand) refuses this question, but has sent the SDO question: then only silence
  // after that one counts.
  const auto port = s_.dispatcher.port().status();
  const bool mute = !guarded && guarded.error().code == Errc::bus && port.up && !port.bus_off;
  const bool silent = mute || (!guarded && guarded.error().code == Errc::timeout);
  if (silent) s_.vacancy[id.value()] = began;
  co_return false;
}

rt::Task<Result<NodeId>> Inquiry::active_id(LssAddress device, bool whole, rt::Duration pause) {
  const auto quick = co_await active_id_once(device, whole);
  if (quick || quick.error().code != Errc::timeout) co_return quick;
  const lss::MasterOptions before = s_.lss.options();
  lss::MasterOptions slower = before;
  slower.inhibit = std::max(slower.inhibit, pause);
  s_.lss.set_options(slower);
  const auto slow = co_await active_id_once(device, whole);
  if (!slow) s_.lss.set_options(before);
  co_return slow;
}

rt::Task<Result<NodeId>> Inquiry::active_id_once(LssAddress device, bool whole) {
  const auto quiet = co_await s_.lss.switch_global(lss::State::waiting);
  if (!quiet) co_return fail(quiet.error());
  lss::ServiceOptions patience = s_.lss.options().service;
  patience.full_window = whole;
  const auto selected = co_await s_.lss.switch_selective(device, patience);
  if (!selected) co_return fail(selected.error());
  const auto reply = co_await lss::ask_node_id(s_.lss, device, patience);
  const bool tells = reply && reply->has_value();
  const bool doubtful = lss::suspicious(*selected) || (tells && lss::suspicious(**reply));
  if (doubtful) {
    const Binder::Options options;
    Binder binder(s_, options);
    const Outcome single = co_await binder.confirm_clone(device);
    if (single == Outcome::several) {
      const auto calm = co_await s_.lss.switch_global(lss::State::waiting);
      if (!calm) co_return fail(calm.error());
      co_return fail(Errc::duplicate, "two devices answer to one LSS address");
    }
  }
  const auto released = co_await s_.lss.switch_global(lss::State::waiting);
  if (!reply) co_return fail(reply.error());
  if (!released) co_return fail(released.error());
  if (!tells) co_return co_await where_it_answers(device);
  const auto id = NodeId::make((*reply)->byte());
  if (!id) co_return fail(Errc::mismatch, "the node-ID it reported is not valid");
  co_return *id;
}

rt::Task<NodeId> Inquiry::where_it_answers(LssAddress device) {
  // Limits the questions at one time, so that unanswered ones use at most half of the bus.
  constexpr double question_bits = 300;
  const double rate = s_.dispatcher.port().status().bit_rate;
  const double most = std::chrono::duration<double>(asked_for).count() * rate / question_bits;
  rt::Scope asked(s_.dispatcher.executor(), static_cast<std::size_t>(std::clamp(most, 2.0, 32.0)));
  NodeId found;
  for (std::uint8_t value = 1; value <= 127; ++value) {
    const NodeId id(value);
    const auto& vacant = s_.vacancy[value];
    const bool silent = vacant && s_.boots.vacant_since(id, *vacant);
    if (!silent) asked.spawn(look_at(id, device, found));
  }
  co_await asked.join();
  co_return found;
}

rt::Task<void> Inquiry::look_at(NodeId id, LssAddress device, NodeId& found) {
  co::SdoOptions how = s_.sdo.options();
  how.timeout = asked_for;
  how.retries = 0;
  how.abort_on_timeout = false;
  const bool answers = co_await answers_at(id, how, asked_for);
  if (!answers) co_return;
  const auto who = co_await read_identity(s_.sdo, id);
  if (who && who->agrees(Identity(device))) found = id;
}

}  // namespace berth::places
