# The main configuration, checked before Snakemake reads it: Snakemake takes keys that stand twice, and runs what follows `__use_yte__`.
from fusetune.configuration import read_configuration

DEFAULT_CONFIG_FILE = "config/config.yaml"


def told_in_one_line(function, *arguments, **options):
    try:
        return function(*arguments, **options)
    except UserError as error:
        raise WorkflowError(str(error)) from None


def configuration_files():
    """The default file, and those given with --configfile, whose values go before it."""
    given = [os.path.relpath(file) for file in workflow.overwrite_configfiles]
    replaced = workflow.config_settings.replace_workflow_config or not os.path.exists(DEFAULT_CONFIG_FILE)
    return given if given and replaced else [DEFAULT_CONFIG_FILE, *given]


SETTINGS = told_in_one_line(read_configuration, configuration_files(), workflow.config_settings.config)
