// `berth trace`: takes entries from a source through filters to words, numbers or another file, in constant memory.
#include "trace.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <nlohmann/json.hpp>

#include "berth/base/counted.hpp"
#include "berth/command/can_id_text.hpp"
#include "berth/text/printable.hpp"
#include "machine_file.hpp"
#include "trace_known.hpp"
#include "trace_nodes.hpp"
#include "trace_outlet.hpp"
#include "trace_rows.hpp"
#include "trace_source.hpp"

namespace berth::cli {
namespace {

using Json = nlohmann::ordered_json;

double seconds_of(rt::Duration time) { return std::chrono::duration<double>(time).count(); }

std::string key_word(std::uint32_t key) {
  const auto id = key & ~can::extended_flag;
  return key == id ? fmt::format("{:03X}", id) : fmt::format("{:08X}", id);
}

// Ignores case; a slash counts as the dot between an object and its sub-object.
bool begins_so(std::string_view name, std::string_view wanted) {
  const auto plain = [](char c) {
    return c == '/' ? '.' : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  };
  return wanted.size() <= name.size() && std::ranges::equal(name.substr(0, wanted.size()), wanted, {}, plain, plain);
}

bool contains_word(std::string_view text, std::string_view word) {
  const auto same = [](char a, char b) {
    return std::tolower(static_cast<unsigned char>(a)) == std::tolower(static_cast<unsigned char>(b));
  };
  return std::search(text.begin(), text.end(), word.begin(), word.end(), same) != text.end();
}

/// All steps between the source and the output.
class Pipeline final : public trace::Sink, private decode::Rows {
 public:
  Pipeline(const Options& options, const TraceOptions& trace, const KnownNodes& known, std::vector<NodeView> nodes)
      : options_(options),
        trace_(trace),
        known_(known),
        nodes_(known, std::move(nodes)),
        live_(!trace.from.ring && (trace.file.empty() || trace.follow)),
        prints_(!trace.stats && (!trace.to || live_) && !(trace.quiet && trace.to)),
        decodes_(prints_ || trace.filters_rows()),
        decoder_(*this, {.fold = !trace.frames && !trace.table && !writes_and_filters(),
                         .fields = options.json || !trace.objects.empty()}),
        rows_(options.json  ? RowPrinter::Form::json
              : trace.table ? RowPrinter::Form::table
                            : RowPrinter::Form::words,
              live_, trace.time.shown) {}

  std::optional<Failure> open(bool force) {
    if (!trace_.to) return std::nullopt;
    writer_ = trace::make_writer(*trace_.to, {.trc_1_1 = trace_.trc_1_1, .directions = trace_.directions});
    return file_.open(trace_.output.empty() ? "-" : trace_.output, live_, force);
  }
  void attach(const TraceSource& source) { source_ = &source; }

  void entry(const trace::Entry& entry) override {
    ++read_;
    if (!first_) {
      first_ = entry.at;
      rows_.begin(entry.at, known_.machine() ? known_.machine()->buses.size() : source_->buses().size());
    }
    if (!in_time(entry.at) || !wanted_bus(entry.bus)) return;
    if (decodes_) {
      nodes_.look(entry);
      decoder_.entry(entry);
      if (trace_.filters_rows()) return;  // `row` writes and counts
    }
    take(entry);
  }

  void finding(Finding finding) override {
    if (finding.severity == Finding::Severity::error) ++findings_.errors;
    if (findings_.shown == most_shown) {
      ++findings_.not_shown;
      return;
    }
    ++findings_.shown;
    if (options_.json && !prints_) {
      findings_.kept.push_back(std::move(finding));
      return;
    }
    rows_.remark(finding);
  }

  /// Called after each turn: prints and records what has come.
  void settle() {
    if (!live_) return;
    rows_.settle(decoder_.pending(), read_ != settled_);
    settled_ = read_;
    file_.flush();
  }
  [[nodiscard]] bool broken() const noexcept { return rows_.broken() || file_.broken(); }

  int finish(const std::string& file) {
    if (decodes_) decoder_.finish();
    rows_.release_all();
    if (rows_.late() > 0) {
      finding(
          {Finding::Severity::warning,
           file,
           0,
           0,
           {},
           fmt::format("{} out of order: the times of the file go back too far, or a transfer was silent for too long",
                       rows_.late() == 1 ? "1 row comes" : std::to_string(rows_.late()) + " rows come"),
           {}});
    }
    if (findings_.not_shown > 0) finding_of_rest(fmt::format("{} more findings", findings_.not_shown), file);
    rows_.release_all();
    if (writer_) writer_->finish(file_.buffer());
    const auto bad = writer_ ? file_.done() : std::nullopt;
    if (file_.left()) return Exit::failed;
    if (trace_.stats) {
      print_stats(file);
    } else if (writer_) {
      print_conversion(file);
    }
    const auto unprinted = rows_.screen().done();
    const bool nothing = prints_ && !options_.json && taken_ == 0 && read_ > 0 && !rows_.screen().left();
    if (nothing)
      print_error(fmt::format("{}no row: none of {} is what was asked for", file.empty() ? "" : file + ": ",
                              counted(read_, "frame")));
    if (rows_.screen().left()) return Exit::failed;
    if (bad) return tell(*bad, options_.json);
    if (unprinted) return tell(*unprinted, false);
    return findings_.errors > 0 ? Exit::usage : Exit::done;
  }

 private:
  static constexpr std::size_t most_shown = 100;

  [[nodiscard]] bool writes_and_filters() const noexcept {
    return trace_.filters_rows() && (trace_.to || trace_.stats);
  }

  [[nodiscard]] bool in_time(rt::Duration at) const noexcept {
    const auto point = [&](const TracePoint& p) { return p.from_first ? *first_ + p.at : p.at; };
    return (!trace_.time.after || at >= point(*trace_.time.after)) &&
           (!trace_.time.before || at <= point(*trace_.time.before));
  }

  // Decided once per bus; the decoder then learns which nodes are on it.
  [[nodiscard]] bool wanted_bus(std::uint16_t bus) {
    while (wanted_.size() <= bus) {
      const auto number = static_cast<std::uint16_t>(wanted_.size());
      const std::string& name = source_->buses()[number];
      const std::string machine_name = known_.machine_bus(name);
      const bool wanted = trace_.buses.empty() || std::ranges::any_of(trace_.buses, [&](const std::string& b) {
                            return b == name || b == machine_name;
                          });
      wanted_.push_back(wanted);
      nodes_.add_bus(machine_name);
      if (decodes_ && wanted) known_.tell(decoder_, number, name);
    }
    return wanted_[bus];
  }

  [[nodiscard]] bool of_wanted_object(const decode::Row& row) const {
    const auto value = [&](std::string_view key) {
      const auto field = std::ranges::find(row.fields, key, &decode::Field::key);
      return field == row.fields.end() ? std::string() : field->value;
    };
    const auto is_wanted = [&](ObjectRef object, const std::string& name) {
      return std::ranges::any_of(trace_.objects, [&](const ObjectFilter& wanted) {
        if (!wanted.number) return begins_so(name, wanted.name);
        return wanted.number->index == object.index && wanted.number->sub.value_or(object.sub) == object.sub;
      });
    };
    const auto of_pdo = [&](const decode::Field& field) {
      return field.kind == decode::Field::Kind::signal && is_wanted(field.object, field.key);
    };
    const auto object = od::parse_object(value("object"));
    return (object && is_wanted(*object, value("name"))) || std::ranges::any_of(row.fields, of_pdo);
  }

  void row(const decode::Row& row) override {
    const std::uint16_t bus = row.entry->bus;
    if (trace_.filters_rows()) {
      const auto& services = trace_.services;
      if (!services.empty() && std::ranges::find(services, row.meaning.service) == services.end()) return;
      if (!nodes_.wants(row)) return;
      if (!trace_.text.empty() && !contains_word(row.words, trace_.text)) return;
      if (!trace_.objects.empty() && !of_wanted_object(row)) return;
      take(*row.entry);
    }
    if (!prints_) return;
    const auto path = nodes_.about(row);
    rows_.row(row, source_->buses()[bus], path ? multilevel::to_string(*path) : std::string());
    if (rows_.many()) rows_.release(decoder_.pending());
  }

  // Counts and writes an entry that has passed every filter.
  void take(const trace::Entry& entry) {
    ++taken_;
    if (trace_.stats) {
      if (counters_.size() <= entry.bus) counters_.resize(entry.bus + std::size_t{1});
      counters_[entry.bus].add(entry);
    }
    if (!writer_) return;
    writer_->write(entry, source_->buses()[entry.bus], file_.buffer());
    file_.full();
  }

  void finding_of_rest(std::string message, const std::string& file) {
    --findings_.shown;
    const auto severity = findings_.errors > 0 ? Finding::Severity::error : Finding::Severity::warning;
    const auto before = findings_.errors;
    finding({severity, file, 0, 0, {}, std::move(message), {}});
    findings_.errors = before;
  }

  [[nodiscard]] Json findings_json() const {
    Json all = Json::array();
    for (const auto& finding : findings_.kept) {
      std::string text;
      put_json(text, finding);
      all.push_back(Json::parse(text));
    }
    return all;
  }

  [[nodiscard]] Json json_of(std::uint16_t bus) const {
    const auto all = counters_[bus].statistics();
    Json json{{"bus", source_->buses()[bus]},
              {"frames", all.frames},
              {"bits", all.bits},
              {"fd_frames", all.fd_frames},
              {"first_s", seconds_of(all.first)},
              {"last_s", seconds_of(all.last)},
              {"span_s", seconds_of(all.span())},
              {"longest_gap_s", seconds_of(all.longest_gap)},
              {"bitrate", nullptr},
              {"load", nullptr},
              {"ids", Json::array()}};
    if (trace_.bit_rate) {
      json["bitrate"] = *trace_.bit_rate;
      json["load"] = all.load(*trace_.bit_rate);
    }
    for (const auto& id : all.ids) {
      Json one{{"id", command::can_id_text(id.key)},
               {"frames", id.frames},
               {"bits", id.bits},
               {"period_min_s", nullptr},
               {"period_avg_s", nullptr},
               {"period_max_s", nullptr},
               {"jitter_s", nullptr},
               {"load", nullptr}};
      if (id.frames > 1) {
        one["period_min_s"] = seconds_of(id.shortest);
        one["period_avg_s"] = seconds_of(id.average);
        one["period_max_s"] = seconds_of(id.longest);
        one["jitter_s"] = seconds_of(id.jitter);
      }
      if (trace_.bit_rate) one["load"] = load_of(id, all);
      json["ids"].push_back(std::move(one));
    }
    return json;
  }

  [[nodiscard]] double load_of(const trace::IdStatistics& id, const trace::Statistics& all) const {
    const double span = seconds_of(all.span());
    return span > 0 ? static_cast<double>(id.bits) / *trace_.bit_rate / span : 0;
  }

  void print_stats(const std::string& file) {
    std::string& out = rows_.screen().buffer();
    if (options_.json) {
      Json json{{"file", file}, {"format", source_->format()}, {"findings", findings_json()}};
      Json buses = Json::array();
      for (std::uint16_t bus = 0; bus < counters_.size(); ++bus) {
        if (wanted_[bus]) buses.push_back(json_of(bus));
      }
      if (buses.size() == 1) json.update(buses.front());
      json["buses"] = std::move(buses);
      out += json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
      return;
    }
    if (counters_.empty()) out += "no frames\n";
    for (std::uint16_t bus = 0; bus < counters_.size(); ++bus) {
      if (wanted_[bus]) print_stats(out, source_->buses()[bus], counters_[bus].statistics());
    }
  }

  void print_stats(std::string& out, const std::string& bus, const trace::Statistics& all) const {
    out += fmt::format("bus {}\n  frames       {}\n  bits         {}{}\n", text::one_line(bus), all.frames, all.bits,
                       all.fd_frames > 0 ? fmt::format(" (without {} FD frames)", all.fd_frames) : "");
    out += fmt::format("  first        {:.6f} s (end of the frame)\n  last         {:.6f} s\n  span         {:.6f} s\n",
                       seconds_of(all.first), seconds_of(all.last), seconds_of(all.span()));
    out += fmt::format("  longest gap  {:.6f} s\n", seconds_of(all.longest_gap));
    if (trace_.bit_rate)
      out += fmt::format("  load         {:.2f} % at {} bit/s\n", 100 * all.load(*trace_.bit_rate), *trace_.bit_rate);
    out += fmt::format("  {:<10}{:>10}{:>12}{:>14}{:>14}{:>14}{:>14}{}\n", "identifier", "frames", "bits",
                       "shortest ms", "average ms", "longest ms", "jitter ms", trace_.bit_rate ? "    load %" : "");
    const auto ms = [](rt::Duration time) { return std::chrono::duration<double, std::milli>(time).count(); };
    for (const auto& id : all.ids) {
      out += fmt::format("  {:<10}{:>10}{:>12}", key_word(id.key), id.frames, id.bits);
      if (id.frames > 1) {
        out += fmt::format("{:>14.3f}{:>14.3f}{:>14.3f}{:>14.3f}", ms(id.shortest), ms(id.average), ms(id.longest),
                           ms(id.jitter));
      } else if (trace_.bit_rate) {
        out += std::string(56, ' ');
      }
      if (trace_.bit_rate) out += fmt::format("{:>10.2f}", 100 * load_of(id, all));
      out += '\n';
    }
  }

  void print_conversion(const std::string& file) {
    const auto lost = writer_->lost();
    const bool to_screen = trace_.output.empty() || trace_.output == "-";
    if (options_.json && !prints_ && !to_screen) {
      Json json{{"file", file},
                {"from", source_->format()},
                {"to", trace::name(*trace_.to)},
                {"output", trace_.output},
                {"frames", taken_},
                {"lost", lost},
                {"findings", findings_json()}};
      rows_.screen().buffer() += json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
      return;
    }
    std::string words = fmt::format("{} ({}) to {} ({}): {}", file, source_->format(), trace_.output,
                                    trace::name(*trace_.to), counted(taken_, "frame"));
    if (taken_ < read_) words += fmt::format(" of {}", read_);
    if (!to_screen && !live_) rows_.screen().buffer() += text::one_line(words) + "\n";
    if (lost.empty()) return;
    rows_.screen().flush();
    for (const auto& line : lost)
      print_error(fmt::format("{}: {}", to_screen ? "standard output" : trace_.output, line));
  }

  const Options& options_;
  const TraceOptions& trace_;
  const KnownNodes& known_;
  TraceNodes nodes_;
  const TraceSource* source_ = nullptr;
  bool live_;
  bool prints_;
  bool decodes_;
  decode::Decoder decoder_;
  std::unique_ptr<trace::Writer> writer_;
  Outlet file_;
  RowPrinter rows_;
  std::uint64_t settled_ = 0;  // entries read at the last `settle`
  std::vector<bool> wanted_;   // by bus
  std::vector<trace::Counter> counters_;
  std::optional<rt::Duration> first_;
  std::uint64_t read_ = 0;
  std::uint64_t taken_ = 0;
  struct {
    std::uint64_t errors = 0;
    std::uint64_t not_shown = 0;
    std::size_t shown = 0;
    Findings kept;  // for the report at the end
  } findings_;
};

// Takes the format from the name of the output file.
std::optional<Failure> complete(TraceOptions& trace) {
  if (trace.to || trace.output.empty()) return std::nullopt;
  trace.to = trace.output == "-" ? trace::Format::candump : trace::format_of_path(trace.output);
  if (trace.to && trace::is_written(*trace.to)) return std::nullopt;
  return failure(Exit::usage,
                 fmt::format("{}: which format? Write --to, or a name with .log, .pcapng, .asc or .trc", trace.output));
}

}  // namespace

int run_trace(const Options& given, const TraceOptions& written) {
  Options options = given;
  if (written.file.empty() && written.port.empty()) options.machine = default_machine(given);
  TraceOptions trace = written;
  if (const auto bad = complete(trace)) return tell(*bad, options.json);
  if (trace.to && trace.stats)
    return tell(failure(Exit::usage, "--stats and a conversion are two things: run it twice"), options.json);
  const auto known = KnownNodes::load(options, trace);
  if (!known) return tell(known.error(), options.json);
  auto nodes = known->views(trace.nodes);
  if (!nodes) return tell(nodes.error(), options.json);
  auto source = open_source(options, trace, *known);
  if (!source) return tell(source.error(), options.json);
  Pipeline pipeline(options, trace, *known, std::move(*nodes));
  pipeline.attach(**source);
  if (const auto bad = pipeline.open(options.files.force)) return tell(*bad, options.json);
  const auto begin = std::chrono::steady_clock::now();
  std::optional<Failure> failed;
  for (;;) {
    const auto state = (*source)->turn(pipeline);
    pipeline.settle();
    if (!state) failed = state.error();
    if (!state || *state == TraceSource::State::over || pipeline.broken()) break;
    const bool live = trace.follow || trace.file.empty();
    if (live && options.timeout && std::chrono::steady_clock::now() - begin >= *options.timeout) break;
  }
  (*source)->finish(pipeline);
  const std::string live = trace.from.ring ? "the ring" : trace.port;
  const int status = pipeline.finish(trace.file.empty() ? live : trace.file);
  return failed ? tell(*failed, options.json) : status;
}

}  // namespace berth::cli
