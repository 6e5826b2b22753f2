#include "berth/document/machine_document.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "berth/analysis/response.hpp"
#include "berth/base/words.hpp"
#include "berth/command/meanings.hpp"
#include "berth/document/dbc.hpp"
#include "berth/document/device_page.hpp"
#include "berth/document/html.hpp"
#include "berth/od/notation.hpp"
#include "berth/traffic/bus_messages.hpp"

namespace berth::document {
namespace {

double ms(rt::Duration time) { return std::chrono::duration<double, std::milli>(time).count(); }

const char* words(design::Role role) {
  switch (role) {
    case design::Role::master: return "NMT master";
    case design::Role::commissioner: return "commissioner";
    case design::Role::reader: return "reader";
    case design::Role::observer: return "observer";
  }
  return "";
}

const char* words(places::Assign assign) {
  switch (assign) {
    case places::Assign::lss: return "by LSS";
    case places::Assign::fixed: return "fixed";
    case places::Assign::recipe: return "by the device's own objects";
  }
  return "";
}

// The rules of CiA 302-2's startup on this bus, one sentence each.
std::vector<std::string> startup_words(const design::Bus& bus) {
  const auto& rules = bus.startup.rules;
  std::vector<std::string> all;
  if (rules.starts_all_at_once) all.emplace_back("All devices are started at once, when the mandatory ones are ready.");
  if (rules.application_starts) all.emplace_back("The application starts the devices.");
  if (rules.application_operates) all.emplace_back("The application makes the master operational.");
  if (rules.stops_all_on_error) all.emplace_back("An error of a mandatory device stops all nodes.");
  const bool resets = rules.resets_all_on_error && !rules.stops_all_on_error;
  if (resets) all.emplace_back("An error of a mandatory device resets all nodes.");
  if (bus.startup.boot_time > rt::Duration{0})
    all.push_back(fmt::format("The mandatory devices boot within {:g} s.", ms(bus.startup.boot_time) / 1000));
  return all;
}

class Maker {
 public:
  Maker(const design::Machine& machine, const traffic::LinkPlan* links)
      : machine_(machine), links_(links), slots_(configured_slots(machine, links)), devices_(slots_) {}

  std::vector<DocumentFile> run(const std::string& made_by) {
    for (const auto* const bus : machine_.all_buses()) add_bus(*bus);
    for (std::size_t i = 0; i < slots_.size(); ++i) add_slot(slots_[i]);
    for (auto& file : devices_.pages()) files_.push_back(std::move(file));
    std::string body = "<p>Machine file " + markup(machine_.file) + ".</p>\n<h2>Buses</h2>\n" + buses_.made();
    for (const auto* const bus : machine_.all_buses()) body += slots_table(*bus);
    body += links_table();
    body += "<p>" + markup(made_by) + "</p>\n";
    files_.insert(files_.begin(), {"index.html", page(machine_.name, body, false)});
    return std::move(files_);
  }

 private:
  std::size_t number_of(const std::string& bus) const {
    const auto all = machine_.all_buses();
    const auto it = std::ranges::find_if(all, [&](const auto* b) { return b->name == bus; });
    return static_cast<std::size_t>(it - all.begin()) + 1;
  }
  std::string slot_page(const design::Slot& slot) const {
    return fmt::format("slot-{}-{}.html", number_of(slot.spec.name.bus), slot.spec.id.value());
  }
  std::string slot_link(const design::Slot& slot) const {
    return fmt::format("<a href=\"{}\">{}</a>", slot_page(slot), markup(slot.spec.name.name));
  }
  std::string link_of(const std::string& bus, const std::string& name) const {
    for (const auto& slot : machine_.slots) {
      if (slot.spec.name.bus == bus && slot.spec.name.name == name) return slot_link(slot);
    }
    return markup(name);
  }

  std::string dbc_name(const std::string& bus) {
    std::string name;
    for (const char c : bus.substr(0, 40)) {
      const bool good = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
      name += good ? c : '-';
    }
    std::string lower = name;
    for (char& c : lower) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c;
    if (!names_.insert(lower).second) name += fmt::format("-{}", number_of(bus));
    return name + ".dbc";
  }

  void add_bus(const design::Bus& bus) {
    const BusSignals& signals = signals_.emplace_back(signals_of(bus, slots_));
    const std::string dbc = dbc_name(bus.name);
    files_.push_back({dbc, dbc_of(signals)});
    traffic::Assumptions assumed;
    assumed.links = links_;
    const auto found = traffic::messages_of(machine_, bus, assumed);
    const auto result = analysis::analyze(found.line);
    const std::string file = fmt::format("bus-{}.html", number_of(bus.name));
    const auto slots = std::ranges::count(machine_.slots, bus.name, [](const auto& s) { return s.spec.name.bus; });
    buses_.html(fmt::format("<a href=\"{}\">{}</a>", file, markup(bus.name)))
        .number(std::to_string(bus.bitrate))
        .cell(words(bus.role))
        .cell(bus.gateway
                  ? fmt::format("{} node {}, port {}", bus.gateway->bus, bus.gateway->slot.value(), bus.gateway->port)
                  : "")
        .number(std::to_string(slots))
        .number(fmt::format("{:.1f} %", 100 * result.load))
        .html(fmt::format("<a href=\"{0}\">{0}</a>", dbc))
        .end_row();
    std::string body = fmt::format(
        "<p>{0} bit/s; Berth is its {1}. At most {2:.1f} % of the bus. For other tools: "
        "<a href=\"{3}\">{3}</a>.</p>\n",
        bus.bitrate, words(bus.role), 100 * result.load, dbc);
    for (const auto& sentence : startup_words(bus)) body += "<p>" + sentence + "</p>\n";
    body += slots_table(bus) + "<h2>Messages</h2>\n" + messages_table(bus, found.line, result);
    body += "<h2>What they carry</h2>\n" + signals_table(bus, signals);
    for (const auto& note : found.notes) body += "<p>" + markup(to_string(note)) + "</p>\n";
    files_.push_back({file, page("Bus " + bus.name, body)});
  }

  std::string slots_table(const design::Bus& bus) const {
    Table table({"node-ID", "slot", "type", "node-ID is given", "mandatory", "replacement", "configuration"});
    for (const auto& slot : machine_.slots) {
      if (slot.spec.name.bus != bus.name) continue;
      const auto& spec = slot.spec;
      table.number(std::to_string(spec.id.value()))
          .html(slot_link(slot))
          .html(devices_.link(slot))
          .cell(words(spec.assign))
          .cell(spec.mandatory  ? "yes"
                : spec.optional ? "optional"
                                : "no")
          .cell(spec.replacement == places::Replacement::automatic ? "by itself" : "a person is asked")
          .cell(spec.config)
          .end_row();
    }
    const std::string made = table.made();
    return made.empty() ? made : "<h2>Slots on " + markup(bus.name) + "</h2>\n" + made;
  }

  std::string messages_table(const design::Bus& bus, const analysis::Line& line, const analysis::Result& result) const {
    Table table({"identifier", "sender", "message", "bytes", "every, ms", "worst, ms", "deadline, ms", ""});
    for (const auto& r : result.responses) {
      const auto& m = line.messages[r.message];
      const bool missed = m.deadline > rt::Duration{0} && !r.meets_deadline;
      table.number(analysis::key_text(m.key))
          .html(link_of(bus.name, line.senders[m.sender].name))
          .cell(m.name)
          .number(std::to_string(m.data_bytes))
          .number(fmt::format("{:g}", ms(m.period)))
          .number(r.worst ? fmt::format("{:.3f}", ms(*r.worst)) : "no bound")
          .number(m.deadline > rt::Duration{0} ? fmt::format("{:g}", ms(m.deadline)) : "")
          .html(missed                         ? "<span class=\"bad\">missed</span>"
                : m.deadline > rt::Duration{0} ? "kept"
                                               : "")
          .end_row();
    }
    return table.made();
  }

  std::string signals_table(const design::Bus& bus, const BusSignals& signals) const {
    Table table({"identifier", "sender", "message", "bits", "object", "name", "type", "unit", "received by"});
    for (const auto& message : signals.messages) {
      for (const auto& signal : message.signals) {
        if (signal.object.index < 0x1002) continue;  // EMCY's and NMT's own fields
        std::string receivers;
        for (const auto& name : signal.receivers)
          receivers += (receivers.empty() ? "" : ", ") + link_of(bus.name, name);
        table.number(analysis::key_text(message.key))
            .html(link_of(bus.name, message.sender))
            .cell(message.name)
            .number(fmt::format("{} to {}", signal.at, signal.at + signal.bits - 1))
            .cell(od::write_object(signal.object))
            .cell(signal.name)
            .cell(od::name(signal.type))
            .cell(signal.meaning.unit.empty() ? "" : command::one_count(signal.meaning))
            .html(receivers)
            .end_row();
      }
    }
    const std::string made = table.made();
    return made.empty() ? "<p>No PDO with objects that is known.</p>\n" : made;
  }

  std::string links_table() const {
    Table table({"from", "to", "deadline, ms", "worst, ms", "PDO"});
    for (std::size_t i = 0; i < machine_.links.size(); ++i) {
      const auto& link = machine_.links[i];
      std::string to;
      for (const auto& end : link.to) to += (to.empty() ? "" : ", ") + end.slot + "/" + end.object;
      std::optional<rt::Duration> worst;
      std::string pdos;
      for (const auto& pdo : links_ != nullptr ? links_->plan.pdos : std::vector<linker::Pdo>{}) {
        if (std::ranges::find(pdo.links, i) == pdo.links.end()) continue;
        pdos += fmt::format("{}TPDO {} of {}, {:03X}h", pdos.empty() ? "" : "; ", pdo.tpdo,
                            links_->network.nodes[pdo.producer].name, pdo.can_id);
        if (pdo.worst) worst = worst.value_or(rt::Duration{0}) + *pdo.worst;
      }
      table.cell(link.from.slot + "/" + link.from.object)
          .cell(to)
          .number(link.deadline ? fmt::format("{:g}", ms(*link.deadline)) : "")
          .number(worst ? fmt::format("{:.3f}", ms(*worst)) : "")
          .cell(pdos)
          .end_row();
    }
    const std::string made = table.made();
    return made.empty() ? made : "<h2>Links</h2>\n" + made;
  }

  void add_slot(const DescribedSlot& configured) {
    const auto& slot = *configured.slot;
    const auto& spec = slot.spec;
    Table facts({"", ""});
    const auto fact = [&](const char* what, const std::string& html) { facts.cell(what).html(html).end_row(); };
    fact("bus", fmt::format("<a href=\"bus-{}.html\">{}</a>", number_of(spec.name.bus), markup(spec.name.bus)));
    fact("node-ID", fmt::format("{}, {}", spec.id.value(), words(spec.assign)));
    fact("type", devices_.link(slot));
    if (spec.revision) fact("revision", fmt::format("{:08X}h", *spec.revision));
    if (spec.device_type != 0) fact("device type (1000h)", fmt::format("{:08X}h", spec.device_type));
    fact("mandatory", spec.mandatory ? "yes" : spec.optional ? "no: optional" : "no");
    fact("a replacement",
         spec.replacement == places::Replacement::automatic ? "is taken by itself" : "a person confirms");
    if (!spec.config.empty()) fact("configuration", markup(spec.config));
    std::string body = facts.made();
    body += "<h2>PDOs</h2>\n" + slot_pdos(slot);
    body += "<h2>Other than the defaults</h2>\n" + differences(configured);
    files_.push_back({slot_page(slot), page(fmt::format("{} (node {})", spec.name.name, spec.id.value()), body)});
  }

  std::string slot_pdos(const design::Slot& slot) const {
    const auto& signals = signals_[number_of(slot.spec.name.bus) - 1];
    const auto& name = slot.spec.name.name;
    Table table({"identifier", "", "message", "bits", "object", "name"});
    for (const auto& message : signals.messages) {
      for (const auto& signal : message.signals) {
        const bool sends = message.sender == name;
        const bool receives = std::ranges::find(signal.receivers, name) != signal.receivers.end();
        if (signal.object.index < 0x1002 || (!sends && !receives)) continue;
        table.number(analysis::key_text(message.key))
            .cell(sends ? "sends" : "receives")
            .cell(sends || message.sender.empty() ? message.name : message.name + " of " + message.sender)
            .number(fmt::format("{} to {}", signal.at, signal.at + signal.bits - 1))
            .cell(od::write_object(signal.object))
            .cell(signal.name)
            .end_row();
      }
    }
    const std::string made = table.made();
    return made.empty() ? "<p>None that is known.</p>\n" : made;
  }

  const design::Machine& machine_;
  const traffic::LinkPlan* links_;
  std::vector<DescribedSlot> slots_;
  DevicePages devices_;
  std::vector<BusSignals> signals_;
  Table buses_{{"bus", "bit/s", "Berth is", "beneath", "slots", "load at most", "DBC"}};
  std::set<std::string> names_;
  std::vector<DocumentFile> files_;
};

}  // namespace

std::vector<DocumentFile> document_of(const design::Machine& machine, const traffic::LinkPlan* links,
                                      const std::string& made_by) {
  return Maker(machine, links).run(made_by);
}

}  // namespace berth::document
