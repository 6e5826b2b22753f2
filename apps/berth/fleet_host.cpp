#include "fleet_host.hpp"

#include "verbs.hpp"

#if BERTH_MQTT
#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>

#include "berth/fleet/edge.hpp"
#include "berth/mqtt/where.hpp"
#include "system_random.hpp"

namespace berth::cli {
namespace {

using namespace std::chrono_literals;

constexpr auto fleet_pace = 100ms;
// Every Berth has given its births by then, and another second for their way.
constexpr auto answered_after = fleet::births_within + 1000ms;
constexpr auto quiet_for = 500ms;  // nothing has come for this long: all have answered
constexpr auto longest_listening = 20s;
constexpr auto connect_within = 15s;

}  // namespace

std::optional<Failure> FleetHost::start() {
  const char* const from_environment = std::getenv("BERTH_BROKER");
  const std::string broker = !how_.broker.empty() ? how_.broker : from_environment != nullptr ? from_environment : "";
  if (broker.empty())
    return failure(Exit::usage, "no broker: write its address, such as mqtts://broker:8883, or set BERTH_BROKER");
  const auto where = mqtt::parse_where(broker);
  if (!where) return failure(Exit::usage, where.error());
  auto thread = fleet::Thread::start();
  if (!thread) return failure(Exit::failed, thread.error());
  thread_ = std::move(*thread);
  auto random = system_random();
  fleet::WatchOptions wanted;
  wanted.connection.where = *where;
  wanted.connection.login_file = how_.login;
  if (where->tls) wanted.connection.tls = {.authorities = how_.ca, .certificate = how_.certificate, .key = how_.key};
  wanted.host = fmt::format("berth-fleet-{:08x}", random.next() & 0xFFFFFFFFU);
  wanted.connection.client_id = wanted.host;
  if (!how_.group.empty()) wanted.groups = {how_.group};
  auto watch = fleet::Watch::start(*thread_, std::move(wanted), clock_, random.fork());
  if (!watch) return failure(Exit::usage, watch.error());
  watch_ = std::move(*watch);
  return std::nullopt;
}

std::optional<Failure> FleetHost::connect() {
  if (auto no = start()) return no;
  for (auto waited = 0ns; waited < connect_within; waited += fleet_pace) {
    const auto status = watch_->status();
    if (status.connected) return std::nullopt;
    if (ended()) return failure(Exit::failed, "ended before the broker answered");
    if (!status.trouble.empty()) return failure(Exit::failed, status.trouble);
    rest();
  }
  return failure(Exit::failed, "the broker does not answer");
}

void FleetHost::gather() {
  std::uint64_t changes = 0;
  auto quiet = 0ns;
  const auto most = how_.listen.value_or(longest_listening);
  for (auto waited = 0ns; waited < most && !ended(); waited += fleet_pace) {
    rest();
    const auto now = watch_->status().changes;
    quiet = now == changes ? quiet + fleet_pace : 0ns;
    changes = now;
    if (!how_.listen && waited >= answered_after && quiet >= quiet_for) return;
  }
}

std::vector<fleet::MachineView> FleetHost::machines() const {
  std::vector<fleet::MachineView> seen;
  watch_->look([&](const sparkplug::Fleet& fleet) { seen = fleet::machines_of(fleet); });
  return seen;
}

void FleetHost::rest() { wait_for(driver_, interrupt_, fleet_pace); }
bool FleetHost::ended() { return interrupt_.came() || run_must_end(); }

tl::expected<fleet::MachineView, Failure> machine_named(const std::vector<fleet::MachineView>& machines,
                                                        const std::string& name) {
  std::vector<const fleet::MachineView*> meant;
  for (const auto& machine : machines) {
    if (machine.id.node == name || machine.id.group + "/" + machine.id.node == name) meant.push_back(&machine);
  }
  if (meant.empty())
    return tl::unexpected(failure(Exit::no, fmt::format("no machine {} was heard of at this broker", name)));
  if (meant.size() == 1) return *meant.front();
  return tl::unexpected(
      failure(Exit::usage, fmt::format("{} is in {} groups: write GROUP/{}", name, meant.size(), name)));
}

}  // namespace berth::cli
#endif

namespace berth::cli {

void fleet_connection_words(const Verb& verb, FleetConnection& how) {
  verb.word("--login", how.login, "file with the user (first line) and the password (second line) at the broker")
      .shown("FILE");
  verb.word("--ca", how.ca, "with mqtts://: certificates of the CAs that are trusted (PEM; default: the system's)")
      .shown("FILE");
  verb.word("--certificate", how.certificate, "this host's own certificate (PEM)").shown("FILE");
  verb.word("--key", how.key, "its private key (PEM, without a passphrase)").shown("FILE");
  verb.time("--for", how.listen, "listen for so long (default: until all machines have answered, about five seconds)");
}

}  // namespace berth::cli
