#include "berth/studio/mirror.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <random>

#include "berth/can/port_spec.hpp"
#include "berth/command/verbs.hpp"
#include "berth/studio/doors.hpp"

namespace berth::studio {
namespace {

using Json = nlohmann::ordered_json;

std::string dump(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

const char* word_of(command::Form form) noexcept {
  switch (form) {
    case command::Form::word: return "word";
    case command::Form::option: return "option";
    case command::Form::flag: return "flag";
    case command::Form::common: return "common";
    case command::Form::own: return "own";
  }
  return "own";
}

std::string verbs_json() {
  Json all = Json::array();
  for (const auto& verb : command::verbs()) {
    Json parameters = Json::array();
    for (const auto& p : verb.parameters) {
      if (p.personal) continue;  // only for the command line
      parameters.push_back({{"name", p.name},
                            {"help", p.help},
                            {"required", p.required},
                            {"form", word_of(p.form)},
                            {"value", p.value}});
      if (p.changes) parameters.back()["changes"] = true;
      if (!p.spelled.empty()) parameters.back()["spelled"] = p.spelled.substr(0, p.spelled.find(','));
    }
    all.push_back({{"name", verb.name},
                   {"help", verb.help},
                   {"changes", verb.effect() == command::Effect::changes},
                   {"role", command::name(verb.role)},
                   {"parameters", std::move(parameters)}});
  }
  return dump(all);
}

const char* word_of(design::Role role) noexcept {
  switch (role) {
    case design::Role::master: return "master";
    case design::Role::observer: return "observer";
    default: return "commissioner";
  }
}

Json bus_json(const design::Machine& machine, const design::Bus& bus) {
  Json json{{"name", bus.name},
            {"bit_rate", bus.bitrate},
            {"port", bus.own_port ? can::to_string(bus.port) : "gateway"},
            {"role", word_of(bus.role)},
            {"master_id", bus.master.value()},
            {"beneath", nullptr}};
  if (bus.gateway) {
    const auto* const slot = machine.slot(bus.gateway->bus, bus.gateway->slot);
    json["beneath"] = {{"bus", bus.gateway->bus}, {"slot", slot == nullptr ? std::string() : slot->spec.name.name}};
  }
  return json;
}

template <class Texts>
void append_all(const Texts& texts, std::string& out) {
  out += '[';
  for (const auto& text : texts) {
    if (out.back() != '[') out += ',';
    out += text;
  }
  out += ']';
}

std::string lock_json(const Lock& lock) {
  return fmt::format(R"({{"real":{},"unlocked_until_s":{}}})", lock.real,
                     lock.until_s ? fmt::format("{:.3f}", *lock.until_s) : "null");
}

}  // namespace

Mirror::Mirror(const design::Machine& machine, Has has, std::string token_file, std::string signals)
    : verbs_(verbs_json()),
      has_(std::move(has)),
      machine_(machine.name),
      token_file_(std::move(token_file)),
      signals_(std::move(signals)) {
  Json buses = Json::array();
  for (const auto* const bus : machine.all_buses()) {
    buses.push_back(bus_json(machine, *bus));
    buses_.push_back(bus->name);
    bit_rates_.push_back(bus->bitrate);
  }
  head_ = fmt::format(
      R"("start":"{:08x}{:08x}","machine":{},"buses":{})", std::random_device{}(), std::random_device{}(),
      dump(Json{{"name", machine.name}, {"simulated", has_.simulated}, {"fleet", has_.fleet}, {"file", machine.file}}),
      dump(buses));
}

std::string Mirror::take(const News& news) {
  if (news.is_empty()) return {};
  std::vector<std::string> slots;
  for (const auto& slot : news.slots) {
    slots.push_back(operate::to_json(slot));
    const auto [at, made] = index_.try_emplace({slot.bus, slot.id.value()}, slots_.size());
    if (made) slots_.emplace_back();
    slots_[at->second] = slots.back();
  }
  std::vector<std::string> events;
  for (const auto& event : news.events) {
    events.push_back(operate::to_json(event));
    events_.push_back(events.back());
    event_bytes_ += events_.back().size();
    while (events_.size() > 1 && (events_.size() > most_events || event_bytes_ > most_event_bytes)) {
      event_bytes_ -= events_.front().size();
      events_.pop_front();
    }
  }
  if (news.lock) lock_ = *news.lock;
  if (news.questions) {
    questions_.clear();
    for (const auto& question : *news.questions) questions_.push_back(operate::to_json(question));
  }
  if (news.pace) pace_ = *news.pace;
  std::string out = fmt::format(R"({{"type":"change","seq":{},"time_s":{:.6f},"slots":)", ++seq_, news.time_s);
  append_all(slots, out);
  out += ",\"events\":";
  append_all(events, out);
  if (news.events_left_out > 0) out += fmt::format(",\"events_left_out\":{}", news.events_left_out);
  if (news.lock) out += ",\"lock\":" + lock_json(*news.lock);
  if (news.questions) {
    out += ",\"questions\":";
    append_all(questions_, out);
  }
  if (news.pace) out += ",\"world\":" + world_json(news.time_s);
  if (!news.written.empty()) {
    out += ",\"written\":";
    append_all(news.written, out);
  }
  out += '}';
  return out;
}

std::string Mirror::world_json(double time_s) const {
  if (!has_.simulated) return "null";
  return fmt::format(R"({{"paused":{},"speed":{},"time_s":{:.6f}}})", pace_.paused, pace_.speed, time_s);
}

std::string Mirror::snapshot(double time_s, command::Role role) const {
  std::string out = fmt::format(R"({{"type":"snapshot","seq":{},{},"slots":)", seq_, head_);
  append_all(slots_, out);
  out += ",\"events\":";
  append_all(events_, out);
  out += ",\"questions\":";
  append_all(questions_, out);
  out +=
      fmt::format(R"(,"time_s":{:.6f},"verbs":{},"lock":{},"role":"{}","token_file":{},"world":{}}})", time_s, verbs_,
                  lock_json(lock_), name(role),
                  dump(token_file_.empty() ? token_file_ : TokenFiles::file_of(token_file_, role)), world_json(time_s));
  return out;
}

std::string reply_json(const std::string& id, const command::Reply& reply) {
  Json json;
  if (!id.empty()) json = {{"type", "reply"}, {"id", id}};
  json["status"] = reply.status;
  json["reply"] = Json::parse(reply.json, nullptr, false);
  if (json["reply"].is_discarded()) json["reply"] = Json::object();
  json["lines"] = reply.lines;
  json["error"] = reply.error;
  return dump(json);
}

std::string error_json(const std::string& words) { return dump(Json{{"type", "error"}, {"error", words}}); }

}  // namespace berth::studio
