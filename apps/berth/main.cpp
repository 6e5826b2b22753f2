// The command line: all verbs, in the order of the help. docs/architecture.md says how to add one.
#include <string_view>

#include "candidates.hpp"
#include "output.hpp"
#include "verbs.hpp"

namespace berth::cli {

const std::vector<AddVerb>& all_verbs() {
  static const std::vector<AddVerb> verbs{
      add_demo,      add_init,    add_ports,   add_up,      add_studio,     add_scan,      add_status,
      add_watch,     add_history, add_bind,    add_locate,  add_replace,    add_forget,    add_poll,
      add_configure, add_upload,  add_backup,  add_program, add_boot,       add_sdo,       add_note,
      add_nmt,       add_lss,     add_emcy,    add_store,   add_restore,    add_send,      add_eds,
      add_doctor,    add_trace,   add_analyze, add_link,    add_document,   add_reproduce, add_compare,
      add_study,     add_serve,   add_gateway, add_adopt,   add_export,     add_import,    add_device,
      add_sim,       add_world,   add_plant,   add_fleet,   add_completion, add_man,       add_version};
  return verbs;
}

}  // namespace berth::cli

int main(int argc, char** argv) {
  using namespace berth::cli;
  secure_streams();
  if (argc > 1 && std::string_view(argv[1]) == complete_word) {
    return with_output(run_complete(all_verbs(), {argv + 2, argv + argc}));
  }
  return with_output(run_command_line(argc, argv, all_verbs()));
}
