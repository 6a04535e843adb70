# The main configuration, checked before Snakemake reads it: Snakemake takes keys that stand twice, and runs what follows `__use_yte__`.
from fusetune.configuration import read_configuration
from fusetune.running.workflow_files import packaged_config

DEFAULT_CONFIG_FILE = "config/config.yaml"
if not os.path.exists(DEFAULT_CONFIG_FILE):
    DEFAULT_CONFIG_FILE = str(packaged_config() / "config.yaml")


def told_in_one_line(function, *arguments, **options):
    try:
        return function(*arguments, **options)
    except UserError as error:
        raise WorkflowError(str(error)) from None


def configuration_files():
    """The default file, and those given with --configfile, whose values go before it; none for a module with values."""
    if workflow.modifier.skip_configfile:
        return []
    given = [os.path.relpath(file) for file in workflow.overwrite_configfiles]
    return given if given and workflow.config_settings.replace_workflow_config else [DEFAULT_CONFIG_FILE, *given]


GIVEN_NAME = f"config of the module {__name__}" if workflow.modifier.skip_configfile else "--config"
GIVEN_CONFIG = config if workflow.modifier.skip_configfile else workflow.config_settings.config
SETTINGS = told_in_one_line(read_configuration, configuration_files(), GIVEN_CONFIG, GIVEN_NAME)
