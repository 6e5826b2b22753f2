// `berth program image`: makes a program's image, with the header that Berth's devices expect (docs/programs.md).
#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>

#include "berth/device/program_image.hpp"
#include "berth/text/file.hpp"
#include "output.hpp"
#include "outputs.hpp"
#include "verbs.hpp"

namespace berth::cli {
namespace {

struct ImageOptions {
  std::string content;
  std::string image;
  std::optional<unsigned> vendor;
  std::optional<unsigned> product;
  std::optional<unsigned> days;
  std::optional<unsigned> ms;
  bool dry_run = false;
};

int make_image(const Options& options, const ImageOptions& wanted) {
  Findings findings;
  const auto text = text::read_file(wanted.content, findings);
  if (!text) return tell(failure(findings), options.json);
  if (text->empty()) return tell(failure(Exit::usage, wanted.content + " is empty: it is not a program"), options.json);
  const std::vector<std::uint8_t> content(text->begin(), text->end());
  device::ProgramHead head;
  head.type = {wanted.vendor.value_or(0), wanted.product.value_or(0)};
  head.date = wanted.days.value_or(0);
  head.time = wanted.ms.value_or(0);
  const auto image = device::make_program_image(head, content);
  const auto made = device::read_program_head(image);
  if (!wanted.dry_run) {
    const std::string bytes(image.begin(), image.end());
    if (const auto bad = may_write(wanted.image, "the image", options.files.force)) return tell(*bad, options.json);
    if (const auto bad = write_output(wanted.image, bytes)) return tell(*bad, options.json);
  }
  const std::string identification = fmt::format("0x{:08X}", made->crc);
  if (options.json) {
    const nlohmann::ordered_json json{
        {"file", wanted.image}, {"bytes", image.size()}, {"identification", identification}};
    print_text(json.dump(2));
  } else {
    print_line(fmt::format("{}  {} bytes, identification {}", wanted.image, image.size(), identification));
  }
  return Exit::done;
}

}  // namespace

void add_program_image(const Verb& program, Options& options) {
  const auto wanted = std::make_shared<ImageOptions>();
  const Verb image = program.add("image", "an image for a device of Berth's, out of a program's bytes",
                                 [&options, wanted] { return make_image(options, *wanted); });
  json_flag(image, options);
  force_word(image, options);
  image.word("content", wanted->content, "the program").required();
  image.word("image", wanted->image, "the file to write").required();
  image.word("--vendor", wanted->vendor, "vendor-ID of the product (default: any)").shown("NUMBER");
  image.word("--product", wanted->product, "its product code").shown("NUMBER");
  image.word("--days", wanted->days, "its date (1F52h:01): days since 1984-01-01").shown("N");
  image.word("--ms", wanted->ms, "its time (1F52h:02): milliseconds after midnight").shown("N");
  image.flag("--dry-run", wanted->dry_run, "say what it would be, and write nothing");
  image.footer("Example:\n  berth program image drive.bin drive.bprg --vendor 1 --product 48");
}

}  // namespace berth::cli
